#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "us_ct_registration/ultrasound/sweep_assembly.h"

/// Small sweeps, their frames as a scanner would stream them, and an assembler that receives them.
namespace usct::test {

constexpr int kSamples = 4;
constexpr int kLines = 3;
constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kPeriod_ns = kSecond / 10;

/// Every frame differs from every other one.
inline std::vector<std::uint8_t> voxels(int frames) {
  std::vector<std::uint8_t> data;
  for (int i = 0; i < frames * kSamples * kLines; ++i)
    data.push_back(static_cast<std::uint8_t>((i * 37) % 251));
  return data;
}

/// A motorised sweep with steps of 0.02 rad, rising or falling.
inline PreScanVolume motorised(int frames, double direction = 1.0) {
  PreScanVolume volume;
  MotorSweep sweep{27.25, {}, 0.011 * direction};
  for (int i = 0; i < frames; ++i)
    sweep.frame_angles_rad.push_back(direction * (0.02 * i - 0.01 * frames));
  volume.geometry = {{kSamples, 3.1, 0.37}, CurvilinearArray{40.3, {-0.1, 0.03, 0.1}}, sweep};
  volume.voxels = voxels(frames);
  return volume;
}

/// A tracked sweep that moves by 1 mm per frame along z.
inline PreScanVolume tracked(int frames) {
  PreScanVolume volume;
  TrackedSweep sweep;
  for (int i = 0; i < frames; ++i) {
    sweep.T_us_frame.emplace_back(Eigen::Translation3d(7.0, -3.0, i) *
                                  Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()));
    sweep.frame_times_s.push_back(0.1 * i);
  }
  volume.geometry = {{kSamples, 3.1, 0.37}, LinearArray{{-1.0, 0.0, 1.0}}, sweep};
  volume.voxels = voxels(frames);
  return volume;
}

using Frames = std::vector<StreamedFrame>;

inline std::vector<std::uint8_t> image_of(const PreScanVolume& volume, int frame) {
  const auto begin =
      volume.voxels.begin() + static_cast<std::ptrdiff_t>(volume.offset(0, 0, frame));
  return {begin, begin + kSamples * kLines};
}

inline void set_image(StreamedFrame& frame, std::vector<std::uint8_t> image) {
  frame.brightness = std::make_shared<const std::vector<std::uint8_t>>(std::move(image));
}

/// The frames of a volume as a scanner would stream them; the last one has the stamp `end_s`.
inline Frames frames_of(const PreScanVolume& volume, double end_s, std::uint32_t sweep = 0) {
  const int count = volume.geometry.frames();
  Frames frames(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    StreamedFrame& frame = frames[k];
    frame.sweep = sweep;
    frame.index = static_cast<std::uint32_t>(i);
    frame.frames_in_sweep = static_cast<std::uint32_t>(count);
    frame.stamp_ns = static_cast<std::int64_t>(end_s) * kSecond - (count - 1 - i) * kPeriod_ns;
    frame.frame_id = "us";
    frame.axial = volume.geometry.axial;
    frame.array = volume.geometry.array;
    if (const auto* motor = std::get_if<MotorSweep>(&volume.geometry.motion)) {
      frame.motor =
          MotorFrame{motor->motor_radius_mm, motor->frame_angles_rad[k], motor->frame_travel_rad};
    } else {
      frame.frame_id = "array";
      frame.pose = FramePose{std::get<TrackedSweep>(volume.geometry.motion).T_us_frame[k], "us"};
    }
    set_image(frame, image_of(volume, i));
  }
  return frames;
}

inline const MotorSweep& motor_of(const EndedSweep& sweep) {
  return std::get<MotorSweep>(sweep.assembled->volume.geometry.motion);
}

inline const TrackedSweep& track_of(const EndedSweep& sweep) {
  return std::get<TrackedSweep>(sweep.assembled->volume.geometry.motion);
}

inline int frame_count(const EndedSweep& sweep) {
  return sweep.assembled->volume.geometry.frames();
}

/// Feeds frames at their times, one per period, and keeps the sweeps that end.
class Stream {
 public:
  explicit Stream(const AssemblyOptions& options = {}) : assembler(options) {}

  void send(const StreamedFrame& frame) {
    now_ns_ += kPeriod_ns;
    take(assembler.add(std::make_shared<const StreamedFrame>(frame), now_ns_));
  }
  void send(const Frames& frames) {
    for (const StreamedFrame& frame : frames) send(frame);
  }
  void pass(double seconds) {
    now_ns_ += std::llround(seconds * 1e9);
    take(assembler.end_after_pause(now_ns_));
  }
  std::uint64_t dropped(const std::string& reason) const {
    const auto found = assembler.dropped().find(reason);
    return found == assembler.dropped().end() ? 0 : found->second;
  }

  SweepAssembler assembler;
  std::vector<EndedSweep> ended;

 private:
  void take(const std::vector<EndedSweep>& sweeps) {
    ended.insert(ended.end(), sweeps.begin(), sweeps.end());
  }
  std::int64_t now_ns_ = 5000 * kSecond;
};

/// Expects equality bit by bit; of times to the nanosecond, the resolution of stamps.
inline void expect_equal(const EndedSweep& sweep, const PreScanVolume& expected) {
  ASSERT_TRUE(sweep.assembled) << sweep.message;
  const PreScanVolume& found = sweep.assembled->volume;
  EXPECT_EQ(found.voxels, expected.voxels);
  EXPECT_EQ(found.geometry.axial.start_depth_mm, expected.geometry.axial.start_depth_mm);
  EXPECT_EQ(found.geometry.axial.spacing_mm, expected.geometry.axial.spacing_mm);
  EXPECT_EQ(line_table(found.geometry.array), line_table(expected.geometry.array));
  ASSERT_EQ(found.geometry.is_motorised(), expected.geometry.is_motorised());
  if (const auto* motor = std::get_if<MotorSweep>(&expected.geometry.motion)) {
    EXPECT_EQ(motor_of(sweep).motor_radius_mm, motor->motor_radius_mm);
    EXPECT_EQ(motor_of(sweep).frame_angles_rad, motor->frame_angles_rad);
    EXPECT_EQ(motor_of(sweep).frame_travel_rad, motor->frame_travel_rad);
    return;
  }
  const auto& track = std::get<TrackedSweep>(expected.geometry.motion);
  ASSERT_EQ(track_of(sweep).T_us_frame.size(), track.T_us_frame.size());
  for (std::size_t i = 0; i < track.T_us_frame.size(); ++i) {
    EXPECT_EQ(track_of(sweep).T_us_frame[i].matrix(), track.T_us_frame[i].matrix());
    EXPECT_NEAR(track_of(sweep).frame_times_s[i], track.frame_times_s[i], 1e-9);
  }
}

}  // namespace usct::test
