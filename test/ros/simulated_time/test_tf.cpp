#include <gtest/gtest.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>
#include <us_ct_registration/PreScanVolume.h>

#include <algorithm>

#include "clock.h"
#include "ros/conversions/ultrasound.h"
#include "ros/process.h"
#include "ros/tf_source.h"
#include "ros/us_ingest/inbox.h"

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

  static msg::PreScanVolume sweep(const std::string& us_frame, const ::ros::Time& stamp) {
    PreScanVolume volume;
    MotorSweep motor{27.25, {}, 0.011};
    for (int i = 0; i < 12; ++i) motor.frame_angles_rad.push_back(0.0213 * i - 0.1);
    volume.geometry = {{20, 3.1, 0.37}, CurvilinearArray{40.3, {-0.1, 0.03, 0.1}}, motor};
    volume.voxels.resize(12 * 3 * 20);
    for (std::size_t i = 0; i < volume.voxels.size(); ++i)
      volume.voxels[i] = static_cast<std::uint8_t>(i % 251);
    std_msgs::Header header;
    header.frame_id = us_frame;
    header.stamp = stamp;
    return to_message(volume, header);
  }

  static tf2_msgs::TFMessage pose_of(const std::string& us_frame, const ::ros::Time& stamp) {
    tf2_msgs::TFMessage message;
    message.transforms.resize(1);
    message.transforms[0].header.frame_id = "patient";
    message.transforms[0].header.stamp = stamp;
    message.transforms[0].child_frame_id = us_frame;
    message.transforms[0].transform.rotation.w = 1.0;
    return message;
  }

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

}  // namespace
}  // namespace usct::ros_interface
