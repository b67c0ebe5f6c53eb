#include <diagnostic_msgs/DiagnosticArray.h>
#include <sensor_msgs/PointCloud2.h>
#include <us_ct_registration/Alignment.h>

#include <atomic>

#include "registration_client.h"

namespace usct::ros_interface {
namespace {

using Eigen::Isometry3d;
using testing::AllOf;
using testing::HasSubstr;

constexpr unsigned kCtRevision = 7;
const Isometry3d kPatientUsAtStart = test::rigid({0.2, 0.7, -0.4}, {110, 60, 900});

/// The nodes of a namespace run as processes, or as nodelets of one manager.
class TimeAndMotion : public testing::TestWithParam<const char*> {
 protected:
  TimeAndMotion() : client_(GetParam()), tf_(client_.node, processes()) {}

  static std::set<std::string> processes() {
    const std::string space = std::string("/") + GetParam();
    if (space == "/nodelets") return {space + "/manager"};
    return {space + "/registration", space + "/us_cloud", space + "/tf_publisher"};
  }

  Result register_moving(double share, double drift_mm, const std::string& us_frame) {
    const MovingSweep moving = moving_sweep(kPatientUsAtStart, share, drift_mm, us_frame);
    const ::ros::Time end = moving.sweep.header.stamp;
    tf_.publish(moving.poses);
    client_.send_ct(agar().ct, kCtRevision, end - ::ros::Duration(30.0));
    EXPECT_EQ(client_.set(kPatientUsAtStart * test::nearby(agar()), "patient").status.code,
              Status::OK);
    client_.send(moving.sweep);
    return client_.call_until([&](const Result& result) {
      return result.us_stamp == end && result.ct_revision == kCtRevision;
    });
  }

  RegistrationClient client_;
  TfSource tf_;
};

double measure(const Result& result, const std::string& name) {
  for (const msg::Measure& one : result.measures)
    if (one.name == name) return one.value;
  return -1.0;
}

TEST_P(TimeAndMotion, ASweepOfAMovingProbeIsCompensated) {
  const std::string frame = std::string("us_compensated_") + GetParam();
  const Result result = register_moving(0.05, 0.0, frame);
  ASSERT_EQ(result.status.code, Status::REGISTERED) << result.status.message;
  const Isometry3d T_patient_ct = from_message_mm(result.fixed_transform, "result");
  EXPECT_LT(agar().error_mm(kPatientUsAtStart.inverse() * T_patient_ct), kGoodMm);
  EXPECT_GT(measure(result, "sweep_motion_mm"), 3.0);
  EXPECT_LT(measure(result, "sweep_motion_mm"), 10.0);
}

TEST_P(TimeAndMotion, ASweepOfAProbeThatMovesFarIsRefused) {
  const std::string frame = std::string("us_far_") + GetParam();
  // 100 mm in 4.3 s: 2.3 mm within the window around the stamp, where 3 mm are allowed.
  const Result result = register_moving(0.0, 100.0, frame);
  EXPECT_EQ(result.status.code, Status::TF_JUMPED) << result.status.message;
  EXPECT_THAT(result.status.message,
              AllOf(HasSubstr("during the sweep"), HasSubstr("max_sweep_motion_mm"),
                    HasSubstr("100.0 mm")));
  EXPECT_EQ(result.header.frame_id, frame);
  EXPECT_TRUE(is_zero(result.fixed_transform));
}

/// One message with a stamp in the year 2106 must not end a node: `required` in the launch file
/// would end the test.
TEST_P(TimeAndMotion, StampsFarFromNowEndNoNode) {
  const ::ros::Publisher results = client_.node.advertise<Result>("registration/result", 1);
  const ::ros::Publisher alignments =
      client_.node.advertise<msg::Alignment>("registration/alignment", 1);
  // The nodelets of a manager share a connection; the client has one of its own to the results.
  const bool in_one_process = GetParam() == std::string("nodelets");
  EXPECT_TRUE(eventually([&] {
    return alignments.getNumSubscribers() >= (in_one_process ? 1U : 2U) &&
           results.getNumSubscribers() >= (in_one_process ? 2U : 3U);
  }));
  for (const std::uint32_t seconds : {4294967200U, 4294967295U}) {
    const ::ros::Time far(seconds, 0);
    client_.send_ct(agar().ct, 8, far);
    msg::PreScanVolume sweep = agar_ultrasound(far, "us_far_future");
    client_.send(sweep);
    EXPECT_THAT(client_.call_until_code(Status::INVALID_MESSAGE).status.message,
                HasSubstr("ahead of this node's clock"));
    tf_.publish(tf_of_us(far, kPatientUsAtStart, "us_far_future"));
    Result result;
    result.header = header("us", far);
    result.us_stamp = result.ct_stamp = far;
    result.id = seconds;
    results.publish(result);
    msg::Alignment alignment;
    alignment.header = header("patient", far);
    alignment.state = msg::Alignment::NONE;
    alignment.accepted = far;
    alignments.publish(alignment);
  }
  // All nodes still work, and diagnostics still come.
  std::atomic<int> clouds{0};
  const ::ros::Subscriber cloud = client_.node.subscribe<sensor_msgs::PointCloud2>(
      "us/cloud", 10, [&](const auto&) { ++clouds; });
  std::atomic<int> reports{0};
  const ::ros::Subscriber diagnostics = client_.node.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 100, [&](const diagnostic_msgs::DiagnosticArray::ConstPtr& array) {
        for (const auto& status : array->status)
          if (status.name.rfind(std::string(GetParam()) + "/", 0) == 0) ++reports;
      });
  const std::string frame = std::string("us_after_") + GetParam();
  EXPECT_EQ(register_moving(0.0, 0.0, frame).status.code, Status::REGISTERED);
  EXPECT_TRUE(eventually([&] { return clouds > 0 && reports > 4; }));
}

INSTANTIATE_TEST_SUITE_P(Registration, TimeAndMotion, testing::Values("processes", "nodelets"));

}  // namespace
}  // namespace usct::ros_interface
