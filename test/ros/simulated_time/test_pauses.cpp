#include <gtest/gtest.h>
#include <sensor_msgs/Image.h>
#include <us_ct_registration/PreScanFrame.h>
#include <us_ct_registration/PreScanVolume.h>

#include <random>

#include "clock.h"
#include "ros/process.h"
#include "ros/tf_source.h"
#include "ros/us_ingest/inbox.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using diagnostic_msgs::DiagnosticArray;

constexpr int kFrames = 12;
constexpr double kPeriod_s = 0.05;
const ::ros::Time kStart(1000.0);

::ros::Time stamp_of(int frame) { return kStart + ::ros::Duration(kPeriod_s * frame); }

std::vector<std::uint8_t> random_bytes(std::size_t count, int seed) {
  std::mt19937 random(static_cast<unsigned>(seed));
  std::vector<std::uint8_t> bytes(count);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

/// A motorised frame that does not say how many there are, so that a pause ends the sweep.
msg::PreScanFrame frame(int i) {
  msg::PreScanFrame frame;
  frame.header.frame_id = "us";
  frame.header.stamp = stamp_of(i);
  frame.index = static_cast<std::uint32_t>(i);
  frame.geometry.type = msg::ProbeGeometry::MOTORISED_CURVILINEAR;
  frame.geometry.probe_radius = 0.0403;
  frame.geometry.motor_radius = 0.0273;
  frame.geometry.line_angles = {-0.1, 0.03, 0.1};
  frame.geometry.start_depth = 0.003;
  frame.geometry.sample_spacing = 0.0004;
  frame.motor_angle = 0.02 * i;
  frame.motor_travel = 0.011;
  frame.lines = 3;
  frame.samples = 20;
  frame.data = random_bytes(60, i);
  return frame;
}

/// An image as config/images/generic_convex.yaml describes it.
sensor_msgs::Image image(int i) {
  sensor_msgs::Image image;
  image.header.frame_id = "us_array";
  image.header.stamp = stamp_of(i);
  image.encoding = "mono8";
  image.width = image.step = 640;
  image.height = 480;
  image.data = random_bytes(std::size_t{640} * 480, i);
  return image;
}

/// A recording that is replayed to a node which ends sweeps after a pause. A person pauses the
/// recording in the middle of a sweep, and it ends right after the sweep.
class ReplayedSweep : public testing::Test {
 protected:
  ReplayedSweep() : clock_(node_), diagnostics_(node_, "/diagnostics") {}

  template <typename Message>
  void expect_one_sweep(const std::string& space, const std::string& topic,
                        Message (*message_of)(int)) {
    const Inbox<msg::PreScanVolume> volumes(node_, space + "/us/volume");
    const ::ros::Publisher publisher = node_.advertise<Message>(space + topic, 100);
    ASSERT_TRUE(eventually([&] { return publisher.getNumSubscribers() == 1; }));
    ASSERT_TRUE(volumes.wait_for_publisher());
    // A frame that overtakes the first time is refused, for its stamp lies ahead.
    clock_.set(kStart);
    ASSERT_TRUE(eventually([&] { return knows_time(space); }));
    const auto play = [&](int from, int to) {
      for (int i = from; i < to; ++i) {
        clock_.set(stamp_of(i));
        publisher.publish(message_of(i));
      }
      EXPECT_TRUE(eventually([&] { return is_recording(space, ", " + std::to_string(to) + " "); }))
          << to;
    };
    play(0, kFrames / 2);
    ::ros::WallDuration(3.0 * kPause_s).sleep();
    EXPECT_TRUE(volumes.all().empty());
    play(kFrames / 2, kFrames);
    EXPECT_TRUE(volumes.all().empty());
    clock_.end();
    ASSERT_TRUE(volumes.wait(1));
    EXPECT_EQ(volumes.all()[0]->frames, static_cast<unsigned>(kFrames));
    EXPECT_EQ(volumes.all()[0]->header.stamp, stamp_of(kFrames - 1));
    EXPECT_TRUE(eventually([&] { return is_recording(space, "no"); }));
  }

  /// Whether the time has begun for the node, which stamps its diagnostics with it.
  bool knows_time(const std::string& space) const {
    for (const auto& message : diagnostics_.all())
      for (const auto& status : message->status)
        if (status.name.find(space) != std::string::npos && message->header.stamp >= kStart)
          return true;
    return false;
  }
  /// Whether the node's last diagnostics say so of the sweep that is recorded.
  bool is_recording(const std::string& space, const std::string& text) const {
    bool is_told = false;
    for (const auto& message : diagnostics_.all())
      for (const auto& status : message->status)
        for (const auto& value : status.values)
          if (status.name.find(space) != std::string::npos && value.key == "recording")
            is_told = value.value.find(text) != std::string::npos;
    return is_told;
  }

  static constexpr double kPause_s = 1.0;
  ::ros::NodeHandle node_;
  Clock clock_;
  Inbox<DiagnosticArray> diagnostics_;
};

TEST_F(ReplayedSweep, OfFramesIsOneVolume) {
  const Process process("us_ingest",
                        {"__ns:=frames", "_sweep_pause:=1.0", "_diagnostic_period:=0.05"});
  expect_one_sweep("frames", "/us/frames", frame);
}

TEST_F(ReplayedSweep, OfImagesIsOneVolume) {
  const Process process("us_ingest", {"__ns:=images", "_sweep_control:=pause", "_sweep_pause:=1.0",
                                      "_diagnostic_period:=0.05"});
  clock_.set(kStart);
  const TfSource tf(node_, {"/images/us_ingest"});
  tf2_msgs::TFMessage poses;
  for (int i = 0; i < kFrames; ++i) {
    geometry_msgs::TransformStamped T;
    T.header.stamp = stamp_of(i);
    T.header.frame_id = "base";
    T.child_frame_id = "us_array";
    T.transform.translation.z = 0.001 * i;
    T.transform.rotation.w = 1.0;
    poses.transforms.push_back(T);
  }
  tf.publish(poses);
  expect_one_sweep("images", "/us/image", image);
}

}  // namespace
}  // namespace usct::ros_interface
