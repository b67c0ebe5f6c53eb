#include <diagnostic_msgs/DiagnosticArray.h>
#include <sensor_msgs/PointCloud2.h>
#include <sensor_msgs/point_cloud2_iterator.h>
#include <us_ct_registration/Alignment.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>

#include "registration_client.h"
#include "ros/conversions/surface_markers.h"
#include "ros/process.h"

namespace usct::ros_interface {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

const Isometry3d kPatientUsAtCloud = test::rigid({-0.3, 0.2, 0.5}, {-80, 200, 700});

/// A frame of its own, since tf_publishers of other namespaces broadcast theirs.
const std::string kCtAtCloud = "ct_of_us_cloud";

struct Cloud {
  std::vector<Vector3d> points_mm;
  std::vector<float> intensities;
};

Cloud points_of(const sensor_msgs::PointCloud2& message) {
  Cloud cloud;
  if (message.data.empty()) return cloud;
  sensor_msgs::PointCloud2ConstIterator<float> x(message, "x");
  for (; x != x.end(); ++x) {
    cloud.points_mm.push_back(kMmPerM * Vector3d(x[0], x[1], x[2]));
    cloud.intensities.push_back(x[3]);
  }
  return cloud;
}

double worst_distance_mm(const Cloud& a, const Cloud& b) {
  EXPECT_EQ(a.points_mm.size(), b.points_mm.size());
  double worst = 0.0;
  for (std::size_t i = 0; i < std::min(a.points_mm.size(), b.points_mm.size()); ++i)
    worst = std::max(worst, (a.points_mm[i] - b.points_mm[i]).norm());
  return worst;
}

class UsCloudNode : public testing::Test {
 protected:
  UsCloudNode()
      : node_("clouds"),
        tf_(node_, {"/clouds/us_cloud"}),
        us_(node_.advertise<msg::PreScanVolume>("us/volume", 1)),
        ct_(node_.advertise<msg::CtVolume>("ct/volume", 1)),
        surface_(node_.advertise<MarkerArray>("ct/surface", 1)),
        alignment_(node_.advertise<msg::Alignment>("registration/alignment", 1)),
        proposed_(node_.advertise<msg::Alignment>("registration/proposed", 1)),
        us_cloud_(node_, "us/cloud"),
        ct_cloud_(node_, "ct/cloud"),
        placed_markers_(node_, "ct/surface_placed"),
        proposed_markers_(node_, "ct/surface_proposed"),
        diagnostics_(node_, "/diagnostics") {
    for (const ::ros::Publisher* publisher : {&us_, &ct_, &surface_, &alignment_, &proposed_})
      EXPECT_TRUE(eventually([&] { return publisher->getNumSubscribers() == 1; }))
          << publisher->getTopic();
  }

  /// The cloud of a moving probe's sweep.
  Cloud cloud_of_moving(double share, bool with_stamps, const std::string& us_frame) {
    MovingSweep moving = moving_sweep(kPatientUsAtCloud, share, 0.0, us_frame);
    const ::ros::Time end = moving.sweep.header.stamp;
    tf_.publish(moving.poses);
    if (!with_stamps) moving.sweep.frame_stamps.clear();
    us_.publish(moving.sweep);
    return points_of(us_cloud_.wait([&](const auto& cloud) { return cloud.header.stamp == end; }));
  }

  msg::Alignment alignment(std::uint8_t state, std::uint32_t ct_crc32) const {
    msg::Alignment message;
    message.header = header("patient", ::ros::Time::now());
    message.state = state;
    message.ct_frame = kCtAtCloud;
    message.ct_crc32 = ct_crc32;
    message.transform = to_message(kPatientUsAtCloud * agar().T_us_ct_true);
    message.message = "result 5 waits for accept or reject";
    return message;
  }

  /// Announces an alignment that is in force: tf has it, for longer than a test takes.
  void accept(std::uint32_t ct_crc32) {
    constexpr double kLongS = 25.0;
    const msg::Alignment accepted = alignment(msg::Alignment::ACCEPTED, ct_crc32);
    tf2_msgs::TFMessage poses;
    for (const double offset_s : {-1.0, kLongS}) {
      poses.transforms.emplace_back();
      poses.transforms.back().header =
          header("patient", ::ros::Time::now() + ::ros::Duration(offset_s));
      poses.transforms.back().child_frame_id = accepted.ct_frame;
      poses.transforms.back().transform = accepted.transform;
    }
    tf_.publish(poses);
    alignment_.publish(accepted);
  }

  ::ros::NodeHandle node_;
  TfSource tf_;
  ::ros::Publisher us_;
  ::ros::Publisher ct_;
  ::ros::Publisher surface_;
  ::ros::Publisher alignment_;
  ::ros::Publisher proposed_;
  Newest<sensor_msgs::PointCloud2> us_cloud_;
  Newest<sensor_msgs::PointCloud2> ct_cloud_;
  Newest<MarkerArray> placed_markers_;
  Newest<MarkerArray> proposed_markers_;
  Newest<diagnostic_msgs::DiagnosticArray> diagnostics_;
};

TEST_F(UsCloudNode, ShowsEachFrameWhereTheProbeWasAtItsStamp) {
  const Cloud still = cloud_of_moving(0.0, true, "us_cloud_still");
  ASSERT_GT(still.points_mm.size(), 1000U);
  const Cloud moving = cloud_of_moving(0.05, true, "us_cloud_moving");
  EXPECT_LT(worst_distance_mm(still, moving), 0.01);
  EXPECT_EQ(still.intensities, moving.intensities);
  // Without stamps of its frames the sweep would lie where the probe was in the end.
  EXPECT_GT(worst_distance_mm(still, cloud_of_moving(0.05, false, "us_cloud_unknown")), 1.0);
}

TEST_F(UsCloudNode, ShowsTheCtOnlyWithAnAlignmentOfThisCt) {
  const msg::CtVolume ct = to_message(agar().ct, header("ct", ::ros::Time::now()), 3);
  ASSERT_NE(ct.crc32, 0U);
  ct_.publish(ct);
  cloud_of_moving(0.0, true, "us_cloud_with_ct");
  accept(ct.crc32);
  ct_cloud_.wait([](const auto& cloud) { return cloud.width > 1000; });
  accept(ct.crc32 + 1);
  ct_cloud_.wait([](const auto& cloud) { return cloud.width == 0; });
  accept(ct.crc32);
  ct_cloud_.wait([](const auto& cloud) { return cloud.width > 1000; });
  alignment_.publish(alignment(msg::Alignment::NONE, 0));
  ct_cloud_.wait([](const auto& cloud) { return cloud.width == 0; });
}

TEST_F(UsCloudNode, MarksWhatWaitsForAPersonUntilItIsDecided) {
  const msg::CtVolume ct = to_message(agar().ct, header("ct", ::ros::Time::now()), 4);
  ct_.publish(ct);
  cloud_of_moving(0.0, true, "us_cloud_proposed");
  MarkerArray surfaces;
  surfaces.markers.resize(1);
  surfaces.markers[0].type = Marker::TRIANGLE_LIST;
  surfaces.markers[0].ns = "2 kidney";
  surfaces.markers[0].id = 2;
  surfaces.markers[0].points.resize(3);
  surface_.publish(surfaces);
  const auto is_gone = [](const MarkerArray& array) {
    return array.markers.size() == 1 && array.markers[0].action == Marker::DELETEALL;
  };
  const auto is_shown = [](const MarkerArray& array) { return array.markers.size() == 3; };
  proposed_.publish(alignment(msg::Alignment::PROPOSED, ct.crc32));
  const MarkerArray shown = proposed_markers_.wait(is_shown);
  ASSERT_EQ(shown.markers.size(), 3U);
  EXPECT_EQ(shown.markers[0].action, Marker::DELETEALL);
  for (std::size_t i : {1, 2}) {
    EXPECT_EQ(shown.markers[i].ns, "PROPOSED");
    EXPECT_EQ(shown.markers[i].header.frame_id, "patient");
  }
  const Vector3d ct_mm = (kPatientUsAtCloud * agar().T_us_ct_true).translation();
  EXPECT_NEAR(kMmPerM * shown.markers[1].pose.position.x, ct_mm.x(), 1e-6);
  EXPECT_EQ(shown.markers[1].points.size(), 3U);
  EXPECT_THAT(shown.markers[2].text, testing::HasSubstr("PROPOSED: result 5 waits"));
  proposed_.publish(alignment(msg::Alignment::PROPOSED, ct.crc32 + 1));
  proposed_markers_.wait(is_gone);
  proposed_.publish(alignment(msg::Alignment::PROPOSED, ct.crc32));
  proposed_markers_.wait(is_shown);
  proposed_.publish(alignment(msg::Alignment::NONE, 0));
  proposed_markers_.wait(is_gone);
}

TEST_F(UsCloudNode, NeverPlacesTheSurfacesOfAnotherCt) {
  const msg::CtVolume ct = to_message(agar().ct, header("ct", ::ros::Time::now()), 5);
  ct_.publish(ct);
  cloud_of_moving(0.0, true, "us_cloud_surfaces");
  Surface triangle;
  triangle.points_mm = {{0, 0, 0}, {10, 0, 0}, {0, 20, 0}};
  triangle.triangles = {{0, 1, 2}};
  const auto surfaces_of = [&](std::uint32_t ct_crc32) {
    return to_markers({{2, triangle}}, {}, "ct", ct_crc32);
  };
  const auto triangles = [](const MarkerArray& array) {
    return std::count_if(array.markers.begin(), array.markers.end(),
                         [](const Marker& marker) { return !marker.points.empty(); });
  };
  const auto are_shown = [&](const MarkerArray& array) { return triangles(array) == 1; };
  const auto are_gone = [&](const MarkerArray& array) { return triangles(array) == 0; };
  accept(ct.crc32);
  surface_.publish(surfaces_of(ct.crc32));
  placed_markers_.wait(are_shown);
  surface_.publish(surfaces_of(ct.crc32 + 1));
  placed_markers_.wait(are_gone);
  // Those of the next CT, once its alignment is in force.
  accept(ct.crc32 + 1);
  placed_markers_.wait(are_shown);
}

TEST_F(UsCloudNode, SaysInDiagnosticsWhyUltrasoundIsNotShown) {
  const auto status = [](std::int8_t level, const std::string& text) {
    return [=](const diagnostic_msgs::DiagnosticArray& array) {
      return std::any_of(array.status.begin(), array.status.end(), [&](const auto& one) {
        return one.name.rfind("clouds/us_cloud", 0) == 0 && one.level == level &&
               one.message.find(text) != std::string::npos;
      });
    };
  };
  cloud_of_moving(0.0, true, "us_cloud_good");
  diagnostics_.wait(status(diagnostic_msgs::DiagnosticStatus::OK, "ultrasound is shown"));
  us_.publish(agar_ultrasound(::ros::Time::now(), "us_cloud_nowhere"));
  diagnostics_.wait(status(diagnostic_msgs::DiagnosticStatus::WARN, "us_cloud_nowhere"));
  us_.publish(agar_ultrasound(::ros::Time(), "us_cloud_good"));
  diagnostics_.wait(status(diagnostic_msgs::DiagnosticStatus::WARN, "'header.stamp' is 0"));
  cloud_of_moving(0.0, true, "us_cloud_good_again");
  diagnostics_.wait(status(diagnostic_msgs::DiagnosticStatus::OK, "ultrasound is shown"));
}

/// Somebody reads in the diagnostics which frames are not connected, and connects them.
TEST_F(UsCloudNode, ShowsUltrasoundOnceItsFrameIsConnected) {
  MovingSweep moving = moving_sweep(kPatientUsAtCloud, 0.0, 0.0, "us_cloud_late");
  us_.publish(moving.sweep);
  diagnostics_.wait([](const diagnostic_msgs::DiagnosticArray& array) {
    return std::any_of(array.status.begin(), array.status.end(), [](const auto& one) {
      return one.message.find("us_cloud_late") != std::string::npos;
    });
  });
  tf_.publish(moving.poses);
  us_cloud_.wait(
      [&](const auto& cloud) { return cloud.header.stamp == moving.sweep.header.stamp; });
}

/// rviz goes on showing what a node has sent that has died, and its latched messages with it.
TEST(UsCloudStart, TakesAwayWhatADeadNodeMayHaveLeftInRviz) {
  ::ros::NodeHandle node("started_again");
  const Newest<MarkerArray> placed(node, "ct/surface_placed");
  const Newest<MarkerArray> proposed(node, "ct/surface_proposed");
  const Newest<MarkerArray> refused(node, "ct/surface_refused");
  const Newest<sensor_msgs::PointCloud2> ct(node, "ct/cloud");
  const Newest<sensor_msgs::PointCloud2> refused_ct(node, "ct/cloud_refused");
  const Process us_cloud("us_cloud",
                         {"__ns:=started_again", "__name:=us_cloud", "_fixed_frame:=patient"});
  // Nobody sends it anything.
  for (const auto* markers : {&placed, &proposed, &refused})
    markers->wait([](const MarkerArray& array) {
      return array.markers.size() == 1 && array.markers[0].action == Marker::DELETEALL &&
             array.markers[0].header.frame_id == "patient";
    });
  for (const auto* cloud : {&ct, &refused_ct})
    cloud->wait([](const sensor_msgs::PointCloud2& message) {
      return message.width == 0 && message.header.frame_id == "patient";
    });
}

}  // namespace
}  // namespace usct::ros_interface
