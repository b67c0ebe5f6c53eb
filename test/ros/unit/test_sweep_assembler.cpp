#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/make_shared.hpp>
#include <cmath>

#include "ros/conversions.h"
#include "ros/frames.h"
#include "ros/sweep_assembler.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr int kSamples = 4;
constexpr int kLines = 3;
constexpr double kPeriod_s = 0.1;

/// Every frame differs from every other one.
std::vector<std::uint8_t> voxels(int frames) {
  std::vector<std::uint8_t> data;
  for (int i = 0; i < frames * kSamples * kLines; ++i)
    data.push_back(static_cast<std::uint8_t>((i * 37) % 251));
  return data;
}

msg::PreScanVolume stamped(PreScanVolume volume, double end_s) {
  volume.voxels = voxels(volume.geometry.frames());
  std_msgs::Header header;
  header.frame_id = "us";
  header.stamp = ::ros::Time(end_s);
  return to_message(volume, header);
}

/// Steps of 0.02 rad, rising or falling.
msg::PreScanVolume motorised(int frames, double end_s, double direction = 1.0) {
  PreScanVolume volume;
  MotorSweep sweep{27.25, {}, 0.011 * direction};
  for (int i = 0; i < frames; ++i)
    sweep.frame_angles_rad.push_back(direction * (0.02 * i - 0.01 * frames));
  volume.geometry = {{kSamples, 3.1, 0.37}, CurvilinearArray{40.3, {-0.1, 0.03, 0.1}}, sweep};
  return stamped(volume, end_s);
}

/// Moves by 1 mm per frame along z.
msg::PreScanVolume tracked(int frames, double end_s) {
  PreScanVolume volume;
  TrackedSweep sweep;
  for (int i = 0; i < frames; ++i) {
    sweep.T_us_frame.emplace_back(Eigen::Translation3d(7.0, -3.0, i) *
                                  Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()));
    sweep.frame_times_s.push_back(kPeriod_s * i);
  }
  volume.geometry = {{kSamples, 3.1, 0.37}, LinearArray{{-1.0, 0.0, 1.0}}, sweep};
  return stamped(volume, end_s);
}

std::vector<msg::PreScanFrame> frames_of_sweep(const msg::PreScanVolume& volume,
                                               std::uint32_t sweep = 0) {
  FrameStream stream;
  stream.sweep = sweep;
  stream.frame_period = ::ros::Duration(kPeriod_s);
  return frames_of(volume, stream);
}

/// Feeds frames as they would come, one per period, and keeps what ends.
class Stream {
 public:
  explicit Stream(const AssemblyOptions& options = {}) : assembler(options) {}

  void send(const StreamedFrame& frame) {
    now_ += ::ros::Duration(kPeriod_s);
    take(assembler.add(frame, now_));
  }
  void send(const msg::PreScanFrame& frame) {
    StreamedFrame streamed;
    streamed.frame = boost::make_shared<msg::PreScanFrame>(frame);
    send(streamed);
  }
  void send(const std::vector<msg::PreScanFrame>& frames) {
    for (const msg::PreScanFrame& frame : frames) send(frame);
  }
  void pass(double seconds) {
    now_ += ::ros::Duration(seconds);
    take(assembler.end_after_pause(now_));
  }
  std::uint64_t dropped(const std::string& reason) const {
    const auto found = assembler.dropped().find(reason);
    return found == assembler.dropped().end() ? 0 : found->second;
  }

  SweepAssembler assembler;
  std::vector<EndedSweep> ended;

 private:
  void take(std::vector<EndedSweep> sweeps) {
    ended.insert(ended.end(), sweeps.begin(), sweeps.end());
  }
  ::ros::Time now_{5000.0};
};

/// The same but for the stamps of frames, which a motorised volume need not have.
void expect_equal(msg::PreScanVolume found, const msg::PreScanVolume& expected) {
  if (expected.frame_stamps.empty()) found.frame_stamps.clear();
  EXPECT_EQ(found, expected);
}

TEST(SweepAssembler, VolumesComeBackBitByBitInEitherDirection) {
  Stream stream;
  const msg::PreScanVolume forth = motorised(6, 100.0);
  const msg::PreScanVolume back = motorised(6, 102.0, -1.0);
  const msg::PreScanVolume poses = tracked(5, 104.0);
  stream.send(frames_of_sweep(forth, 3));
  stream.send(frames_of_sweep(back, 4));
  stream.send(frames_of_sweep(poses, 5));
  ASSERT_EQ(stream.ended.size(), 3u);
  ASSERT_TRUE(stream.ended[0].volume && stream.ended[1].volume && stream.ended[2].volume);
  expect_equal(*stream.ended[0].volume, forth);
  expect_equal(*stream.ended[1].volume, back);
  expect_equal(*stream.ended[2].volume, poses);
  EXPECT_EQ(stream.ended[0].volume->frame_stamps.size(), 6u);
  EXPECT_TRUE(stream.assembler.dropped().empty());
}

TEST(SweepAssembler, ASweepOfUnknownLengthEndsWithTheNextOrAPause) {
  Stream stream;
  for (std::uint32_t sweep : {0u, 1u})
    for (msg::PreScanFrame frame : frames_of_sweep(motorised(6, 100.0 + sweep), sweep)) {
      frame.frames_in_sweep = 0;
      stream.send(frame);
    }
  ASSERT_EQ(stream.ended.size(), 1u);
  stream.pass(0.9);
  EXPECT_EQ(stream.ended.size(), 1u);
  stream.pass(0.2);
  ASSERT_EQ(stream.ended.size(), 2u);
  expect_equal(*stream.ended[1].volume, motorised(6, 101.0));
}

TEST(SweepAssembler, FramesOutOfOrderAreSortedAndSecondOnesDropped) {
  Stream stream;
  std::vector<msg::PreScanFrame> frames = frames_of_sweep(motorised(6, 100.0));
  std::swap(frames[1], frames[4]);
  frames.insert(frames.begin() + 3, frames[2]);
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 1u);
  expect_equal(*stream.ended[0].volume, motorised(6, 100.0));
  EXPECT_EQ(stream.dropped("same index"), 1u);
}

TEST(SweepAssembler, FewMissingFramesAreLeftOutMoreRefuse) {
  AssemblyOptions options;
  options.max_missing = 0.2;
  Stream stream(options);
  std::vector<msg::PreScanFrame> frames = frames_of_sweep(motorised(10, 100.0));
  frames.erase(frames.begin() + 3, frames.begin() + 5);
  stream.send(frames);
  stream.pass(1.1);
  ASSERT_EQ(stream.ended.size(), 1u);
  ASSERT_TRUE(stream.ended[0].volume) << stream.ended[0].message;
  EXPECT_EQ(stream.ended[0].volume->frames, 8u);
  EXPECT_EQ(stream.ended[0].message, "2 missing");

  for (msg::PreScanFrame& frame : frames) frame.sweep = 1;
  frames.pop_back();
  stream.send(frames);
  stream.pass(1.1);
  ASSERT_EQ(stream.ended.size(), 2u);
  EXPECT_FALSE(stream.ended[1].volume);
  EXPECT_THAT(stream.ended[1].message, HasSubstr("3 of 10 frames are missing"));
  EXPECT_EQ(stream.dropped("missing"), 5u);
}

TEST(SweepAssembler, RepeatedImagesAreDroppedBlankOnesAreNot) {
  Stream stream;
  std::vector<msg::PreScanFrame> frames = frames_of_sweep(tracked(8, 100.0));
  frames[3].data = frames[2].data;
  for (int i : {5, 6}) frames[static_cast<std::size_t>(i)].data.assign(12, 0);
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 1u);
  EXPECT_EQ(stream.ended[0].volume->frames, 7u);
  EXPECT_EQ(stream.ended[0].volume->frame_poses[3], frames[4].pose);
  EXPECT_EQ(stream.dropped("repeated image"), 1u);
}

TEST(SweepAssembler, AMotorThatRestsOrTurnsBack) {
  Stream stream;
  std::vector<msg::PreScanFrame> frames = frames_of_sweep(motorised(8, 100.0, -1.0));
  frames[4].motor_angle = frames[5].motor_angle = frames[3].motor_angle;
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 1u);
  ASSERT_TRUE(stream.ended[0].volume) << stream.ended[0].message;
  EXPECT_EQ(stream.ended[0].volume->frames, 6u);
  EXPECT_EQ(stream.dropped("motor at rest"), 2u);
  EXPECT_EQ(stream.ended[0].volume->frame_travel, -0.011);

  frames = frames_of_sweep(motorised(8, 110.0), 1);
  frames[6].motor_angle = frames[4].motor_angle;
  stream.send(frames);
  EXPECT_THAT(stream.ended[1].message, HasSubstr("turns back at frame 6"));

  frames = frames_of_sweep(motorised(8, 120.0), 2);
  frames[6].motor_travel = -frames[6].motor_travel;
  stream.send(frames);
  EXPECT_THAT(stream.ended[2].message, HasSubstr("'motor_travel' changes"));
}

TEST(SweepAssembler, LateFramesAreDroppedAndASenderMayStartAnew) {
  Stream stream;
  const std::vector<msg::PreScanFrame> frames = frames_of_sweep(motorised(6, 100.0));
  stream.send(frames);
  stream.send(frames[4]);
  const std::vector<msg::PreScanFrame> next = frames_of_sweep(motorised(6, 103.0), 1);
  stream.send(next[0]);
  stream.send(frames[5]);  // does not end the sweep that has begun
  EXPECT_EQ(stream.dropped("late"), 2u);
  stream.send({next.begin() + 1, next.end()});
  ASSERT_EQ(stream.ended.size(), 2u);
  expect_equal(*stream.ended[1].volume, motorised(6, 103.0));

  // The same bag once more, then a sender that died within a sweep and counts from 0 again.
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 3u);
  stream.send({next.begin(), next.begin() + 3});
  stream.send(frames_of_sweep(motorised(6, 110.0), 1));
  ASSERT_EQ(stream.ended.size(), 5u);
  EXPECT_THAT(stream.ended[3].message, HasSubstr("3 of 6 frames are missing"));
  expect_equal(*stream.ended[4].volume, motorised(6, 110.0));
}

TEST(SweepAssembler, WhatChangesWithinASweepRefusesIt) {
  const auto refusal = [](const std::function<void(msg::PreScanFrame&)>& change) {
    Stream stream;
    std::vector<msg::PreScanFrame> frames = frames_of_sweep(motorised(6, 100.0));
    change(frames[4]);
    stream.send(frames);
    EXPECT_EQ(stream.ended.size(), 1u);  // its other frames do not begin another sweep
    EXPECT_FALSE(stream.ended[0].volume);
    return stream.ended[0].message;
  };
  EXPECT_THAT(refusal([](auto& f) { f.geometry.line_angles[1] += 1e-9; }),
              HasSubstr("geometry of the probe changes at frame 4"));
  EXPECT_THAT(refusal([](auto& f) {
                f.samples = 2;
                f.data.resize(6);
              }),
              HasSubstr("size changes at frame 4 from 4 x 3 to 2 x 3"));
  EXPECT_THAT(refusal([](auto& f) { f.frames_in_sweep = 7; }), HasSubstr("'frames_in_sweep'"));
  EXPECT_THAT(refusal([](auto& f) { f.header.frame_id = "other"; }), HasSubstr("frame_id"));
  EXPECT_THAT(refusal([](auto& f) { f.header.stamp = ::ros::Time(1.0); }),
              HasSubstr("stamped before"));
}

TEST(SweepAssembler, AbsurdNumbersAreRefusedWithoutMemory) {
  AssemblyOptions options;
  options.max_frames = 50;
  options.max_bytes = 5 * kSamples * kLines;
  Stream stream(options);
  std::vector<msg::PreScanFrame> frames = frames_of_sweep(motorised(6, 100.0));
  frames[0].frames_in_sweep = 4000000000u;
  stream.send(frames[0]);
  ASSERT_EQ(stream.ended.size(), 1u);
  EXPECT_THAT(stream.ended[0].message, HasSubstr("max_frames is 50"));

  for (msg::PreScanFrame& frame : frames) {
    frame.sweep = 1;
    frame.frames_in_sweep = 0;
  }
  frames[2].index = 4000000000u;
  stream.send({frames.begin(), frames.begin() + 3});
  ASSERT_EQ(stream.ended.size(), 2u);
  EXPECT_THAT(stream.ended[1].message, HasSubstr("max_frames is 50"));

  stream.send(frames_of_sweep(motorised(6, 110.0), 2));
  ASSERT_EQ(stream.ended.size(), 3u);
  EXPECT_THAT(stream.ended[2].message, HasSubstr("max_volume_mb"));
}

TEST(SweepAssembler, InvalidFramesAreCountedAndNamed) {
  Stream stream;
  msg::PreScanFrame frame = frames_of_sweep(motorised(6, 100.0))[2];
  const auto problem = [&](const std::function<void(msg::PreScanFrame&)>& spoil) {
    msg::PreScanFrame spoilt = frame;
    spoil(spoilt);
    stream.send(spoilt);
    return stream.assembler.last_problem();
  };
  EXPECT_THAT(problem([](auto& f) { f.data.pop_back(); }), HasSubstr("'data' has 11 values"));
  EXPECT_THAT(problem([](auto& f) { f.index = 6; }), HasSubstr("'frames_in_sweep'"));
  EXPECT_THAT(problem([](auto& f) { f.header.stamp = ::ros::Time(); }), HasSubstr("stamp"));
  EXPECT_THAT(problem([](auto& f) { f.header.frame_id.clear(); }), HasSubstr("frame_id"));
  EXPECT_THAT(problem([](auto& f) { f.motor_angle = std::nan(""); }), HasSubstr("motor_angle"));
  EXPECT_EQ(stream.dropped("invalid"), 5u);
  stream.pass(10.0);
  EXPECT_TRUE(stream.ended.empty());
}

TEST(SweepAssembler, LagShiftsPosesAndStamps) {
  AssemblyOptions options;
  options.image_lag_s = 0.25;
  Stream stream(options);
  stream.send(frames_of_sweep(tracked(8, 100.0)));
  ASSERT_EQ(stream.ended.size(), 1u);
  const msg::PreScanVolume& volume = *stream.ended[0].volume;
  EXPECT_EQ(volume.frames, 5u);  // frames 3 to 7, at the poses of 0.5 to 4.5
  for (std::size_t i = 0; i < 5; ++i)
    EXPECT_NEAR(volume.frame_poses[i].position.z, 1e-3 * (static_cast<double>(i) + 0.5), 1e-9);
  EXPECT_NEAR((volume.header.stamp - ::ros::Time(99.75)).toSec(), 0.0, 1e-8);
  EXPECT_EQ(volume.frame_stamps.back(), volume.header.stamp);
  EXPECT_EQ(stream.dropped("no pose at the stamp minus image_lag"), 3u);

  // A motor has no pose to shift; its volume was acquired earlier than its last stamp.
  stream.send(frames_of_sweep(motorised(6, 110.0), 1));
  ASSERT_EQ(stream.ended.size(), 2u);
  EXPECT_EQ(stream.ended[1].volume->frames, 6u);
  EXPECT_NEAR((stream.ended[1].volume->header.stamp - ::ros::Time(109.75)).toSec(), 0.0, 1e-8);
}

TEST(SweepAssembler, OneImageAllAlongIsRefused) {
  AssemblyOptions options;
  options.image_lag_s = 0.25;
  Stream stream(options);
  std::vector<msg::PreScanFrame> frames = frames_of_sweep(tracked(8, 100.0));
  for (msg::PreScanFrame& frame : frames) frame.data = frames[0].data;
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 1u);
  EXPECT_FALSE(stream.ended[0].volume);
  EXPECT_THAT(stream.ended[0].message, HasSubstr("no image changes"));
}

TEST(SweepAssembler, PosesOfTfCountAndFramesWithoutAreMissing) {
  Stream stream;
  std::vector<msg::PreScanFrame> frames = frames_of_sweep(tracked(10, 100.0));
  for (std::size_t i = 0; i < frames.size(); ++i) {
    StreamedFrame streamed;
    frames[i].pose_frame_id.clear();
    streamed.frame = boost::make_shared<msg::PreScanFrame>(frames[i]);
    streamed.tf_frame_id = "patient";
    if (i == 4)
      streamed.tf_error = "extrapolation";
    else
      streamed.tf_pose = frames[i].pose;
    stream.send(streamed);
  }
  ASSERT_EQ(stream.ended.size(), 1u);
  ASSERT_TRUE(stream.ended[0].volume) << stream.ended[0].message;
  EXPECT_EQ(stream.ended[0].volume->header.frame_id, "patient");
  EXPECT_EQ(stream.ended[0].volume->frames, 9u);
  EXPECT_EQ(stream.ended[0].volume->frame_poses[4], frames[5].pose);
  EXPECT_EQ(stream.dropped("without pose"), 1u);
  EXPECT_THAT(stream.assembler.last_problem(), HasSubstr("frame 4: no pose: extrapolation"));

  frames = frames_of_sweep(tracked(10, 110.0), 1);
  for (msg::PreScanFrame& frame : frames) {
    frame.pose_frame_id.clear();
    stream.send(frame);
  }
  ASSERT_EQ(stream.ended.size(), 2u);
  EXPECT_THAT(stream.ended[1].message, HasSubstr("10 of them for want of a pose"));
}

TEST(SweepAssembler, TimeThatRunsBackwardsForgetsTheSweep) {
  Stream stream;
  const std::vector<msg::PreScanFrame> frames = frames_of_sweep(motorised(6, 100.0));
  stream.send({frames.begin(), frames.begin() + 3});
  stream.pass(-100.0);
  stream.send(frames);
  ASSERT_EQ(stream.ended.size(), 1u);
  expect_equal(*stream.ended[0].volume, motorised(6, 100.0));
}

}  // namespace
}  // namespace usct::ros_interface
