#include <gtest/gtest.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>
#include <us_ct_registration/PreScanVolume.h>

#include <algorithm>

#include "clock.h"
#include "ros/process.h"
#include "ros/tf_source.h"
#include "ros/us_ingest/inbox.h"
#include "sweep.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using diagnostic_msgs::DiagnosticArray;
using diagnostic_msgs::DiagnosticStatus;

/// A node that places sweeps by tf, in simulated time that was set once and stands still: a bag is
/// paused, or has ended. A wait for tf by that time would never end.
class PlacedSweeps : public testing::Test {
 protected:
  PlacedSweeps() : clock_(node_), diagnostics_(node_, "/diagnostics") { clock_.set(kNow); }

  /// The node publishes on `topic` what it makes of each sweep. Whether it does so of one that it
  /// cannot place is its own matter, but it says which frame tf lacks, and goes on.
  template <typename Message>
  void expect_all_sweeps_to_be_taken(const std::string& space, const std::string& program,
                                     const std::string& topic) {
    const Process process(program, {"__ns:=" + space, "_fixed_frame:=patient", "_tf_timeout:=2.0",
                                    "_diagnostic_period:=0.05"});
    const TfSource tf(node_, {"/" + space + "/" + program});
    const ::ros::Publisher sweeps = node_.advertise<msg::PreScanVolume>(space + "/us/volume", 1);
    const Inbox<Message> inbox(node_, space + topic);
    ASSERT_TRUE(eventually([&] { return sweeps.getNumSubscribers() == 1; }));
    const auto is_published = [&](const std::string& us_frame, const ::ros::Time& stamp) {
      tf.publish(pose_of(us_frame, stamp));
      sweeps.publish(sweep(us_frame, stamp));
      return eventually([&] {
        const auto all = inbox.all();
        return std::any_of(all.begin(), all.end(),
                           [&](const auto& one) { return one->header.stamp == stamp; });
      });
    };
    EXPECT_TRUE(is_published("us_first", kNow - ::ros::Duration(2.0)));
    EXPECT_TRUE(wait_for_newest(space, DiagnosticStatus::OK, ""));
    sweeps.publish(sweep("us_nowhere", kNow - ::ros::Duration(1.0)));
    EXPECT_TRUE(wait_for_newest(space, DiagnosticStatus::WARN, "us_nowhere"));
    EXPECT_TRUE(is_published("us_next", kNow));
    EXPECT_TRUE(wait_for_newest(space, DiagnosticStatus::OK, ""));
  }

  /// Waits until the node's newest diagnostics have this level, and `text` in their message.
  bool wait_for_newest(const std::string& space, int level, const std::string& text) const {
    return eventually([&] {
      bool is_told = false;
      for (const auto& message : diagnostics_.all())
        for (const auto& status : message->status)
          if (status.name.find(space) != std::string::npos)
            is_told = status.level == level && status.message.find(text) != std::string::npos;
      return is_told;
    });
  }

  inline static const ::ros::Time kNow{1000.0};
  ::ros::NodeHandle node_;
  Clock clock_;
  Inbox<DiagnosticArray> diagnostics_;
};

TEST_F(PlacedSweeps, AreShownAsClouds) {
  expect_all_sweeps_to_be_taken<sensor_msgs::PointCloud2>("clouds", "us_cloud", "/us/cloud");
}

TEST_F(PlacedSweeps, AreDrawn) {
  expect_all_sweeps_to_be_taken<sensor_msgs::Image>("view", "fusion_view", "/fusion/sheet");
}

/// tf may connect the ultrasound's frame only after the ultrasound has come.
TEST_F(PlacedSweeps, AreDrawnWhereTheyWereOnceTfSaysIt) {
  const Process process("fusion_view", {"__ns:=late", "_fixed_frame:=patient", "_tf_timeout:=0.1",
                                        "_diagnostic_period:=0.05"});
  const TfSource tf(node_, {"/late/fusion_view"});
  const ::ros::Publisher sweeps = node_.advertise<msg::PreScanVolume>("late/us/volume", 1);
  ASSERT_TRUE(eventually([&] { return sweeps.getNumSubscribers() == 1; }));
  sweeps.publish(sweep("us_late", kNow));
  EXPECT_TRUE(wait_for_newest("late", DiagnosticStatus::WARN, "us_late"));
  tf.publish(pose_of("us_late", kNow));
  EXPECT_TRUE(wait_for_newest("late", DiagnosticStatus::OK, ""));
}

}  // namespace
}  // namespace usct::ros_interface
