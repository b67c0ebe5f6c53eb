#include <diagnostic_msgs/DiagnosticArray.h>
#include <us_ct_registration/Alignment.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <thread>

#include "registration_client.h"

namespace usct::ros_interface {
namespace {

using Eigen::Isometry3d;
using testing::AllOf;
using testing::HasSubstr;

/// Broadcasts the pose of the ultrasound's frame in "patient" all the time, from when the node
/// listens.
class Tracking {
 public:
  using Pose = std::function<Isometry3d(double time_s)>;
  Tracking(RegistrationClient& client, Pose pose)
      : pose_(std::move(pose)), tf_(client.node, {client.node.resolveName("registration")}) {
    publish();
    thread_ = std::thread([this] {
      while (!stopping_) publish();
    });
  }
  ~Tracking() {
    stopping_ = true;
    thread_.join();
  }
  Isometry3d T_patient_us(const ::ros::Time& time) const { return pose_(time.toSec()); }

 private:
  void publish() const {
    const ::ros::Time now = ::ros::Time::now();
    tf_.publish(tf_of_us(now, T_patient_us(now), "us"));
    ::ros::WallDuration(0.01).sleep();
  }

  const Pose pose_;
  const TfSource tf_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

const Isometry3d kPatientUs = test::rigid({0.3, -0.8, 0.5}, {210, -90, 1500});

TEST(Registration, FixedFrameNeedsTfAtTheStamp) {
  RegistrationClient client("fixed");
  client.send_ct(agar().ct, 1, ::ros::Time::now() - ::ros::Duration(20.0));
  client.send(agar_ultrasound(::ros::Time::now(), "untracked"));
  EXPECT_THAT(client.call_until_code(Status::TF_UNAVAILABLE).status.message,
              AllOf(HasSubstr("'untracked'"), HasSubstr("'patient'")));

  std::atomic<double> jump_s{std::numeric_limits<double>::infinity()};
  const Tracking tracking(client, [&](double time_s) {
    return time_s < jump_s ? Isometry3d(kPatientUs * test::rigid({0, 0, 0}, {0, 0, 25}))
                           : kPatientUs;
  });
  jump_s = ::ros::Time::now().toSec() + 1.0;
  EXPECT_EQ(client.set(kPatientUs * test::nearby(agar()), "patient").status.code, Status::OK);
  client.send(agar_ultrasound(::ros::Time(jump_s)));
  EXPECT_THAT(client.call_until_code(Status::TF_JUMPED).status.message,
              AllOf(HasSubstr("moved by"), HasSubstr("'us'"), HasSubstr("'patient'")));

  client.send(agar_ultrasound(::ros::Time::now() + ::ros::Duration(20.0)));
  EXPECT_THAT(client.call_until_code(Status::TF_STALE).status.message,
              AllOf(HasSubstr("'us'"), HasSubstr("before the ultrasound's stamp")));
  for (const Result& result : client.published()) EXPECT_TRUE(is_zero(result.fixed_transform));
}

TEST(Registration, ResultIsAnchoredInTheFixedFrame) {
  RegistrationClient client("fixed");
  const Tracking tracking(client, [](double) { return kPatientUs; });
  client.send_ct(agar().ct, 2, ::ros::Time::now() - ::ros::Duration(20.0));
  EXPECT_EQ(client.set(kPatientUs * test::nearby(agar()), "patient").status.code, Status::OK);
  ::ros::Time stamp;
  ASSERT_TRUE(eventually([&] {
    stamp = ::ros::Time::now();
    client.send(agar_ultrasound(stamp));
    return client.call().status.code == Status::REGISTERED;
  }));
  const Result result = client.call();
  ASSERT_EQ(result.status.code, Status::REGISTERED) << result.status.message;
  EXPECT_LT(error_mm(result), kGoodMm);
  EXPECT_EQ(result.fixed_frame, "patient");
  EXPECT_TRUE(from_message_mm(result.fixed_transform, "result")
                  .isApprox(kPatientUs * from_message_mm(result.transform, "result"), 1e-6));
}

/// The patient's phantom as tracked frames, at the same positions in "patient" for any US frame.
msg::PreScanVolume seen_from(const Isometry3d& T_patient_us, const ::ros::Time& stamp) {
  PreScanVolume volume = test::patient_phantom().ultrasound;
  auto& sweep = std::get<TrackedSweep>(volume.geometry.motion);
  sweep.frame_times_s.clear();
  for (Isometry3d& T : sweep.T_us_frame) T = T_patient_us.inverse() * kPatientUs * T;
  return to_message(volume, header("us", stamp));
}

msg::Alignment accepted_alignment(const Isometry3d& T_patient_ct, std::uint32_t ct_crc32) {
  msg::Alignment alignment;
  alignment.header = header("patient", ::ros::Time::now());
  alignment.state = msg::Alignment::ACCEPTED;
  alignment.ct_frame = "ct";
  alignment.ct_crc32 = ct_crc32;
  alignment.policy = "auto";
  alignment.transform = to_message(T_patient_ct);
  alignment.accepted = ::ros::Time::now();
  return alignment;
}

bool was_tracked(const Result& result) {
  const auto has = [&](const char* step) {
    return std::any_of(result.durations.begin(), result.durations.end(),
                       [&](const msg::Measure& duration) { return duration.name == step; });
  };
  return has("tracking") && !has("search");
}

TEST(Registration, ContinuousNodeletFollowsTheProbe) {
  RegistrationClient client("continuous");
  const test::RegistrationCase& images = test::patient_case();
  const Tracking tracking(client, [](double time_s) {
    return Isometry3d(
        kPatientUs * test::rigid({0.05 * std::sin(time_s), 0, 0}, {15.0 * std::sin(time_s), 0, 0}));
  });
  ::ros::Publisher alignment =
      client.node.advertise<msg::Alignment>("registration/alignment", 1, true);
  const std::uint32_t crc32 = to_message(images.ct, header("ct", ::ros::Time(1.0)), 1).crc32;
  alignment.publish(accepted_alignment(kPatientUs * test::nearby(images), crc32));
  client.send_ct(images.ct, 1, ::ros::Time::now() - ::ros::Duration(20.0));
  const auto send = [&] {
    const ::ros::Time now = ::ros::Time::now();
    client.send(seen_from(tracking.T_patient_us(now), now));
  };
  send();
  ASSERT_TRUE(eventually([&] { return client.is_heard(); })) << "no connection to the node";
  constexpr std::size_t kWanted = 6;
  std::vector<Result> registered;
  bool is_accepted = false;
  EXPECT_TRUE(eventually([&] {
    if (!registered.empty() && !is_accepted) {
      alignment.publish(accepted_alignment(kPatientUs * images.T_us_ct_true, crc32));
      is_accepted = true;
    }
    send();
    registered.clear();
    for (const Result& result : client.published())
      if (result.status.code == Status::REGISTERED) registered.push_back(result);
    return registered.size() >= kWanted &&
           std::any_of(registered.begin(), registered.end(), was_tracked);
  })) << registered.size()
      << " of " << client.published().size()
      << "; last: " << (client.published().empty() ? "" : client.published().back().status.message);
  double moved_mm = 0.0;
  for (const Result& result : registered) {
    EXPECT_EQ(result.initial_alignment, "accepted");
    const Isometry3d T_us_ct = from_message_mm(result.transform, "result");
    const Isometry3d T_patient_us = tracking.T_patient_us(result.us_stamp);
    const Isometry3d found = from_message_mm(result.fixed_transform, "result");
    EXPECT_LT(images.error_mm(kPatientUs.inverse() * found), 2.0 * kGoodMm);
    // Poses are some 10 ms apart, and tf interpolates between them.
    EXPECT_LT(images.error_mm(kPatientUs.inverse() * T_patient_us * T_us_ct), 2.5 * kGoodMm);
    moved_mm =
        std::max(moved_mm, (T_us_ct.translation() -
                            from_message_mm(registered.front().transform, "result").translation())
                               .norm());
  }
  EXPECT_GT(moved_mm, 1.0);
  for (std::size_t i = 1; i < registered.size(); ++i)
    EXPECT_GT(registered[i].us_stamp, registered[i - 1].us_stamp);
}

TEST(Registration, ContinuousNodeletAnswersRequestsAndDiagnoses) {
  RegistrationClient client("continuous");
  std::mutex mutex;
  std::map<std::string, std::string> values;
  const ::ros::Subscriber diagnostics = client.node.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 100, [&](const diagnostic_msgs::DiagnosticArray::ConstPtr& array) {
        const std::lock_guard<std::mutex> lock(mutex);
        for (const auto& status : array->status)
          if (status.name == "continuous/registration: registration")
            for (const auto& value : status.values) values[value.key] = value.value;
      });
  EXPECT_NE(client.call().status.code, Status::BUSY);
  std::string newest;
  EXPECT_TRUE(eventually([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    newest = testing::PrintToString(values);
    return values.count("continuous rate, Hz") > 0 && values["CT revision"] == "1" &&
           values.count("last status") > 0 && values["ultrasound volumes held"] != "0";
  })) << newest;
}

/// The next result would take the place of the one that a person looks at.
TEST(Registration, ContinuousNodeletBeginsNothingWhileAResultWaits) {
  RegistrationClient client("continuous");
  const test::RegistrationCase& images = test::patient_case();
  const Tracking tracking(client, [](double) { return kPatientUs; });
  ::ros::Publisher alignment =
      client.node.advertise<msg::Alignment>("registration/alignment", 1, true);
  const std::uint32_t crc32 = to_message(images.ct, header("ct", ::ros::Time(1.0)), 1).crc32;
  msg::Alignment message = accepted_alignment(kPatientUs * images.T_us_ct_true, crc32);
  message.policy = "confirm";
  message.waiting_id = 7;
  alignment.publish(message);
  client.send_ct(images.ct, 1, ::ros::Time::now() - ::ros::Duration(20.0));
  const auto send = [&] {
    const ::ros::Time now = ::ros::Time::now();
    client.send(seen_from(tracking.T_patient_us(now), now));
  };
  // A request is answered nevertheless, and ends the continuous registration that may still run.
  const Result requested = client.call_until([&](const Result& result) {
    if (result.status.message.find("until a person accepts it") != std::string::npos) return true;
    send();
    return false;
  });
  EXPECT_TRUE(eventually(
      [&] { return !client.published().empty() && client.published().back().id == requested.id; }));
  const std::size_t before = client.published().size();
  for (int i = 0; i < 20; ++i) {
    send();
    ::ros::WallDuration(0.05).sleep();
  }
  EXPECT_EQ(client.published().size(), before);
  message.waiting_id = 0;
  alignment.publish(message);
  EXPECT_TRUE(eventually([&] { return client.published().size() > before; }));
}

}  // namespace
}  // namespace usct::ros_interface
