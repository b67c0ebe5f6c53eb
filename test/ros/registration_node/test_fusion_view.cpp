#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PointStamped.h>
#include <sensor_msgs/Image.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/Decide.h>
#include <us_ct_registration/SaveFusion.h>
#include <us_ct_registration/SetFusionMode.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <limits>

#include "registration_client.h"
#include "ros/conversions/registration_result.h"
#include "ros/conversions/times.h"
#include "us_ct_registration/registration/confidence_text.h"
#include "us_ct_registration/rendering/fusion_view.h"

namespace usct::ros_interface {
namespace {

using Eigen::Isometry3d;
using testing::AllOf;
using testing::HasSubstr;

const Isometry3d kPatientUsInView = test::rigid({0.1, -0.4, 0.3}, {40, 90, 700});

bool is_equal(const sensor_msgs::Image& image, const Picture& picture) {
  return image.encoding == "rgb8" && static_cast<int>(image.width) == picture.width &&
         static_cast<int>(image.height) == picture.height && image.data == picture.pixels;
}

/// The nodes of one namespace, of which the results wait for a person.
class FusionViewNodes {
 protected:
  explicit FusionViewNodes(const std::string& name)
      : name_(name),
        client_(name),
        tf_(client_.node, processes(name)),
        sheets_(client_.node, "fusion/sheet"),
        diagnostics_(client_.node, "/diagnostics") {}

  static std::set<std::string> processes(const std::string& name) {
    if (name == "fusion_nodelets") return {"/" + name + "/manager"};
    return {"/" + name + "/registration", "/" + name + "/fusion_view"};
  }

  void send_ct(const CtVolume& ct, unsigned revision) {
    if (!client_.ct_publisher)
      client_.ct_publisher = client_.node.advertise<msg::CtVolume>("ct/volume", 1, true);
    ct_ = to_message(ct, header("ct_of_" + name_, sweep_.header.stamp - ::ros::Duration(30.0)),
                     revision);
    client_.ct_publisher.publish(ct_);
  }

  /// Sends ultrasound that ends now; `share` as of `moving_sweep`.
  void send_ultrasound(double share, const std::string& name) {
    const MovingSweep moving = moving_sweep(kPatientUsInView, share, 0.0, name + "_of_" + name_);
    sweep_ = moving.sweep;
    tf_.publish(moving.poses);
    client_.send(sweep_);
  }

  std::uint8_t decide(const std::string& verb, std::uint64_t id) {
    msg::Decide call;
    call.request.result_id = id;
    const std::string service = client_.node.resolveName("registration/" + verb);
    EXPECT_TRUE(::ros::service::waitForService(service, kLimit));
    // The client may have got the result earlier than the node that decides.
    EXPECT_TRUE(eventually([&] {
      EXPECT_TRUE(::ros::service::call(service, call));
      return call.response.status.code != Status::NOTHING_TO_DECIDE;
    }));
    return call.response.status.code;
  }

  /// The pose of a result as the node should draw it.
  static FusionPose pose_of(const Result& result, PoseStanding standing,
                            const std::string& headline) {
    const RegistrationResult core = registration_result_from(result, "result");
    return {standing, core.T_us_ct ? *core.T_us_ct : core.candidates.at(0).T_us_ct, headline,
            confidence_text(core) + (core.T_us_ct ? evidence_text(core.measures) : "")};
  }

  usct::FusionView drawn(const FusionPose& pose, FusionMode mode = FusionMode::kContours) const {
    FusionViewOptions options;
    options.mode = mode;
    options.pictures.pixel_mm = 1.0;
    const PreScanVolume us = from_message(sweep_, "test");
    const CtVolume ct = from_message(ct_, "test");
    // All sweeps have the same samples.
    static const ScanConverted in_space = in_fusion_space(us);
    ScanConverted simulated;
    if (mode == FusionMode::kSimulated)
      simulated = in_fusion_space(simulate_like(us, ct, *pose.T_us_ct));
    return draw_fusion_view(in_space, &ct, &simulated, pose, options);
  }

  /// Waits until the newest sheet is this one, bit by bit.
  void expect_sheet(const FusionPose& pose, FusionMode mode = FusionMode::kContours) {
    const Picture expected = drawn(pose, mode).sheet;
    sheets_.wait([&](const auto& image) { return is_equal(image, expected); });
  }

  /// Registers the newest ultrasound, which succeeds, and waits for a person.
  Result registered() {
    EXPECT_EQ(client_.set(kPatientUsInView * test::nearby(agar()), "patient").status.code,
              Status::OK);
    const Result result = client_.call_until([&](const Result& r) {
      return r.us_stamp == sweep_.header.stamp && r.ct_revision == ct_.revision;
    });
    EXPECT_EQ(result.status.code, Status::REGISTERED) << result.status.message;
    return result;
  }

  /// Waits until the node's diagnostics, from now on, fulfil the condition.
  template <typename Condition>
  void wait_for_diagnosis(Condition&& condition) {
    const ::ros::Time begin = ::ros::Time::now();
    diagnostics_.wait([&](const diagnostic_msgs::DiagnosticArray& array) {
      return array.header.stamp >= begin &&
             std::any_of(array.status.begin(), array.status.end(), [&](const auto& status) {
               return status.name.rfind(name_ + "/fusion_view", 0) == 0 && condition(status);
             });
    });
  }

  /// A value of the node's diagnostics from now on.
  std::string diagnosed(const std::string& key, const std::string& words = "") {
    std::string value;
    wait_for_diagnosis([&](const diagnostic_msgs::DiagnosticStatus& status) {
      for (const auto& one : status.values)
        if (one.key == key && one.value.find(words) != std::string::npos) {
          value = one.value;
          return true;
        }
      return false;
    });
    return value;
  }

  FusionPose no_pose(const std::string& reason) const {
    return {PoseStanding::kNone, std::nullopt, "NO POSE: " + reason, ""};
  }

  msg::StatusCode save(const std::string& path) {
    msg::SaveFusion call;
    call.request.path = path;
    EXPECT_TRUE(::ros::service::call(client_.node.resolveName("fusion/save"), call));
    return call.response.status;
  }

  std::uint8_t set_mode(const std::string& mode) {
    msg::SetFusionMode call;
    call.request.mode = mode;
    EXPECT_TRUE(::ros::service::call(client_.node.resolveName("fusion/set_mode"), call));
    return call.response.status.code;
  }

  const std::string name_;
  RegistrationClient client_;
  TfSource tf_;
  msg::PreScanVolume sweep_;
  msg::CtVolume ct_;
  Newest<sensor_msgs::Image> sheets_;
  Newest<diagnostic_msgs::DiagnosticArray> diagnostics_;
};

/// The nodes run as processes, or as nodelets of one manager.
class FusionView : public FusionViewNodes, public testing::TestWithParam<const char*> {
 protected:
  FusionView() : FusionViewNodes(GetParam()) {}
};

/// After the tests above, so that the nodes have held images before.
class FusionViewLater : public FusionView {
 protected:
  FusionViewLater() { std::filesystem::create_directories(folder_); }
  ~FusionViewLater() override { std::filesystem::remove_all(folder_); }

  const std::filesystem::path folder_ = "/tmp/usct_fusion_view_test";
};

std::string waiting_text(const RegistrationClient& client, std::uint64_t id) {
  const std::string number = std::to_string(id);
  return "WAITING for a decision: result " + number + ". To accept: rosservice call " +
         client.node.resolveName("registration/accept") + " " + number +
         ". To reject: rosservice call " + client.node.resolveName("registration/reject") + " " +
         number;
}

/// One registration from its ultrasound to the decisions about it, with the nodes that make them.
TEST_P(FusionView, ShowsEachDecisionAsTheCoreDrawsIt) {
  EXPECT_EQ(save("sheet.png").code, Status::NO_ULTRASOUND);
  send_ultrasound(0.0, "us");
  diagnosed("pose", "NO POSE: no CT has arrived");
  send_ct(agar().ct, 3);
  expect_sheet(no_pose("nothing is accepted"));

  const Result result = registered();
  const FusionPose waiting =
      pose_of(result, PoseStanding::kWaiting, waiting_text(client_, result.id));
  expect_sheet(waiting);
  for (const auto& [mode, name] : words_of(FusionMode{})) {
    EXPECT_EQ(set_mode(name), Status::OK);
    expect_sheet(waiting, mode);
  }
  EXPECT_EQ(set_mode("colours"), Status::INVALID_REQUEST);
  EXPECT_EQ(set_mode("contours"), Status::OK);

  EXPECT_EQ(decide("accept", result.id), Status::OK);
  const FusionPose accepted =
      pose_of(result, PoseStanding::kAccepted, "ACCEPTED: result " + std::to_string(result.id));
  expect_sheet(accepted);
  EXPECT_EQ(decide("revert", 0), Status::OK);
  expect_sheet(no_pose("nothing is accepted"));
}

INSTANTIATE_TEST_SUITE_P(Registration, FusionView,
                         testing::Values("fusion_processes", "fusion_nodelets"));

/// A pose of another CT or of other ultrasound is not drawn, and a refused one only as refused.
TEST_P(FusionViewLater, DrawsNoPoseOfOtherImages) {
  send_ultrasound(0.05, "us_moving");
  send_ct(agar().ct, 4);
  const Result result = registered();
  EXPECT_EQ(decide("accept", result.id), Status::OK);
  const std::string accepted = "ACCEPTED: result " + std::to_string(result.id);
  EXPECT_EQ(diagnosed("pose", "ACCEPTED"), accepted);

  CtVolume other = agar().ct;
  ++other.voxels.front();
  send_ct(other, 5);
  EXPECT_THAT(diagnosed("pose", "another CT"), HasSubstr("NO POSE"));
  send_ct(agar().ct, 6);
  diagnosed("pose", accepted);

  const std::string stamp = seconds_text(sweep_.header.stamp);
  send_ultrasound(0.0, "us_later");
  const std::string aside =
      " (the accepted alignment is not drawn: it is of another ultrasound, that of " + stamp +
      " s)";
  EXPECT_EQ(diagnosed("pose", stamp),
            "NO POSE: result " + std::to_string(result.id) + " is broadcast" + aside);

  const ::ros::Publisher results = client_.node.advertise<Result>("registration/result", 1);
  EXPECT_TRUE(eventually([&] { return results.getNumSubscribers() >= 3; }));
  Result refused = result;
  refused.header = sweep_.header;
  refused.us_stamp = sweep_.header.stamp;
  refused.id = result.id + 1;
  refused.status.code = Status::LOW_CONFIDENCE;
  refused.status.message = "of little worth";
  refused.transform = refused.fixed_transform = geometry_msgs::Transform();
  results.publish(refused);
  expect_sheet(pose_of(refused, PoseStanding::kRefused,
                       "REFUSED: this is the best candidate and NOT a registration. of little "
                       "worth" +
                           aside));
  ++refused.ct_crc32;
  results.publish(refused);
  diagnosed("pose", "NO POSE");
}

TEST_P(FusionViewLater, SavesBelowTheFolderOnlyAndDrawsOnlyIfAsked) {
  const std::filesystem::path file = folder_ / "sheet.png";
  const auto stamp = [&] { return seconds_text(sweep_.header.stamp); };
  send_ultrasound(0.0, "us_saved");
  send_ct(agar().ct, 7);
  diagnosed("stamp of the ultrasound (s)", stamp());
  const auto is_of_this = [&](const auto& image) {
    return image.header.stamp == sweep_.header.stamp;
  };
  sheets_.wait(is_of_this);
  sheets_.shut_down();
  EXPECT_EQ(save(file.string()).code, Status::OK);
  wait_for_diagnosis([](const diagnostic_msgs::DiagnosticStatus& status) {
    return status.message == "nobody subscribes to the view";
  });
  const int before = std::stoi(diagnosed("drawings"));
  send_ultrasound(0.0, "us_unseen");
  diagnosed("stamp of the ultrasound (s)", stamp());
  EXPECT_EQ(std::stoi(diagnosed("drawings")), before);

  EXPECT_EQ(save(file.string()).code, Status::OK);
  diagnosed("drawings", std::to_string(before + 1));
  EXPECT_GT(read_png(file).width, 100);
  std::filesystem::create_directory_symlink("/dev", folder_ / "link");
  for (const std::string& path : {std::string("/dev/shm/usct.png"), std::string("../usct.png"),
                                  (folder_ / "link" / "usct.png").string()})
    EXPECT_EQ(save(path).code, Status::PATH_REFUSED) << path;
  EXPECT_EQ(save((folder_ / "sheet.jpg").string()).code, Status::INVALID_REQUEST);
  EXPECT_EQ(save((folder_ / "missing" / "sheet.png").string()).code, Status::FILE_ERROR);
  // What `rosservice call` offers if the tabulator completes the request.
  const msg::StatusCode nameless = save("");
  EXPECT_EQ(nameless.code, Status::INVALID_REQUEST);
  EXPECT_EQ(nameless.message, "'path': is empty");
}

TEST_P(FusionViewLater, ThePlanesMeetWhereSomebodyPoints) {
  send_ultrasound(0.0, "us_pointed");
  send_ct(agar().ct, 8);
  const auto is_of_this = [&](const sensor_msgs::Image& image) {
    return image.header.stamp == sweep_.header.stamp;
  };
  const sensor_msgs::Image middle = sheets_.wait(is_of_this);
  const ::ros::Publisher centre =
      client_.node.advertise<geometry_msgs::PointStamped>("fusion/centre", 1);
  EXPECT_TRUE(eventually([&] { return centre.getNumSubscribers() == 1; }));
  geometry_msgs::PointStamped point;
  point.header = header("patient", ::ros::Time::now());
  point.point = to_message(kPatientUsInView * (agar().T_us_ct_true * agar().ct.grid.centre_mm()));
  centre.publish(point);
  const sensor_msgs::Image moved =
      sheets_.wait([&](const auto& image) { return image.data != middle.data; });
  EXPECT_EQ(moved.header.stamp, sweep_.header.stamp);
  point.point.x = std::numeric_limits<double>::quiet_NaN();
  centre.publish(point);
  sheets_.wait([&](const auto& image) { return image.data == middle.data; });
}

INSTANTIATE_TEST_SUITE_P(Registration, FusionViewLater, testing::Values("fusion_processes"));

TEST(FusionViewStart, WrongParametersEndTheNodeNamingThem) {
  const auto started_with = [](const std::string& parameters) {
    const auto node = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "fusion_view";
    const std::string output = output_of(node.string() + " __name:=wrong " + parameters);
    EXPECT_EQ(std::system("rosparam delete /wrong"), 0);
    return output;
  };
  EXPECT_THAT(started_with("_mode:=colours"),
              AllOf(HasSubstr("/wrong/mode"), HasSubstr("colours"), HasSubstr("exit status 2")));
  EXPECT_THAT(started_with("_save_root:=relative"),
              AllOf(HasSubstr("/wrong/save_root"), HasSubstr("exit status 2")));
  EXPECT_THAT(started_with("_centre:='[0, 1]'"),
              AllOf(HasSubstr("/wrong/centre"), HasSubstr("exit status 2")));
  EXPECT_THAT(started_with("_pixel:=1.0"),
              AllOf(HasSubstr("/wrong/pixel"), HasSubstr("exit status 2")));
}

}  // namespace
}  // namespace usct::ros_interface
