#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/make_shared.hpp>
#include <functional>

#include "ros/bags/frame_stream.h"
#include "ros/conversions/frames.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/ultrasound.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using testing::HasSubstr;

constexpr int kFrames = 6;

msg::PreScanVolume volume_of(const Array& array,
                             const std::variant<MotorSweep, TrackedSweep>& motion) {
  PreScanVolume volume;
  volume.geometry = {{4, 3.1, 0.37}, array, motion};
  for (int i = 0; i < kFrames * 12; ++i)
    volume.voxels.push_back(static_cast<std::uint8_t>((i * 37) % 251));
  std_msgs::Header header;
  header.frame_id = "us";
  header.stamp = ::ros::Time(100.0);
  return to_message(volume, header);
}

msg::PreScanVolume motorised_message() {
  MotorSweep sweep{27.25, {}, 0.011};
  for (int i = 0; i < kFrames; ++i) sweep.frame_angles_rad.push_back(0.02 * i - 0.06);
  return volume_of(CurvilinearArray{40.3, {-0.1, 0.03, 0.1}}, sweep);
}

/// Lengths and quaternions that change when they are scaled to millimetres, or turned into a
/// rotation matrix, and back.
msg::PreScanVolume tracked_message() {
  TrackedSweep sweep;
  for (int i = 0; i < kFrames; ++i) {
    sweep.T_us_frame.emplace_back(
        Eigen::Translation3d(7.1 / (i + 1), -3.3 * i, i) *
        Eigen::AngleAxisd(0.4 + 0.1 * i, Eigen::Vector3d(1, 2, 3).normalized()));
    sweep.frame_times_s.push_back(0.1 * i);
  }
  msg::PreScanVolume volume = volume_of(LinearArray{{-1.0, 0.1, 1.3}}, sweep);
  for (std::size_t i = 0; i < kFrames; ++i) {
    volume.frame_poses[i].position.x += 1.0 / (3.0 + static_cast<double>(i));
    volume.frame_poses[i].orientation.w += 1e-7;
  }
  return volume;
}

msg::PreScanFrame::ConstPtr shared(const msg::PreScanFrame& frame) {
  return boost::make_shared<const msg::PreScanFrame>(frame);
}

/// The message of the one sweep that frames make; `prepare` may change each frame.
msg::PreScanVolume assembled(const std::vector<msg::PreScanFrame>& frames,
                             const std::function<void(ReceivedFrame&)>& prepare = {}) {
  SweepAssembler assembler{AssemblyOptions()};
  std::vector<EndedSweep> ended;
  for (const msg::PreScanFrame& message : frames) {
    const std::shared_ptr<ReceivedFrame> frame = from_message(shared(message));
    if (prepare) prepare(*frame);
    ended = assembler.add(frame, 1);
  }
  EXPECT_EQ(ended.size(), 1u);
  if (ended.empty() || !ended[0].assembled) return {};
  return *to_message(*ended[0].assembled);
}

TEST(Frames, MotorisedVolumesComeBackBitByBit) {
  const msg::PreScanVolume volume = motorised_message();
  msg::PreScanVolume found = assembled(frames_of(volume, {}));
  EXPECT_EQ(found.frame_stamps.size(), 6u);
  found.frame_stamps.clear();  // a motorised volume need not have them
  EXPECT_EQ(found, volume);
}

TEST(Frames, TrackedVolumesComeBackBitByBit) {
  const msg::PreScanVolume volume = tracked_message();
  EXPECT_EQ(assembled(frames_of(volume, {})), volume);
}

TEST(Frames, PosesThatWereLookedUpComeBackBitByBit) {
  msg::PreScanVolume volume = tracked_message();
  std::vector<msg::PreScanFrame> frames = frames_of(volume, {});
  for (msg::PreScanFrame& frame : frames) frame.pose_frame_id.clear();
  const msg::PreScanVolume found = assembled(frames, [&](ReceivedFrame& frame) {
    ASSERT_TRUE(frame.needs_pose());
    frame.set_looked_up(volume.frame_poses[frame.index], "patient");
  });
  volume.header.frame_id = "patient";
  EXPECT_EQ(found, volume);
}

TEST(Frames, BrightnessIsNotCopied) {
  const msg::PreScanFrame::ConstPtr message = shared(frames_of(motorised_message(), {})[0]);
  EXPECT_EQ(from_message(message)->brightness->data(), message->data.data());
}

TEST(Frames, WhatIsMalformedIsNamed) {
  const auto problem = [](msg::PreScanFrame frame,
                          const std::function<void(msg::PreScanFrame&)>& spoil) -> std::string {
    spoil(frame);
    try {
      from_message(shared(frame))->validate(0.0);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no problem";
  };
  const msg::PreScanFrame motor = frames_of(motorised_message(), {})[2];
  EXPECT_EQ(problem(motor, [](auto&) {}), "no problem");
  EXPECT_THAT(problem(motor, [](auto& f) { f.data.pop_back(); }),
              HasSubstr("sweep 0 frame 2: 'data' has 11 values"));
  EXPECT_THAT(problem(motor, [](auto& f) { f.samples = 4000000000u; }),
              HasSubstr("'samples' is 4000000000"));
  EXPECT_THAT(problem(motor, [](auto& f) { f.geometry.line_angles.pop_back(); }),
              HasSubstr("geometry: lines"));
  EXPECT_THAT(problem(motor, [](auto& f) { f.header.stamp = ::ros::Time(); }), HasSubstr("stamp"));
  EXPECT_THAT(problem(motor, [](auto& f) { f.header.frame_id.clear(); }), HasSubstr("frame_id"));
  EXPECT_THAT(problem(motor, [](auto& f) { f.pose_frame_id = "us"; }),
              HasSubstr("'pose_frame_id' is set"));
  const msg::PreScanFrame pose = frames_of(tracked_message(), {})[2];
  EXPECT_EQ(problem(pose, [](auto&) {}), "no problem");
  EXPECT_THAT(problem(pose, [](auto& f) { f.motor_angle = 0.1; }),
              HasSubstr("'motor_angle' is set"));
  EXPECT_THAT(problem(pose, [](auto& f) { f.pose.orientation = geometry_msgs::Quaternion(); }),
              HasSubstr("the quaternion has length 0"));
}

}  // namespace
}  // namespace usct::ros_interface
