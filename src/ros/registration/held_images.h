#pragma once

#include <ros/time.h>
#include <std_msgs/Header.h>

#include <chrono>
#include <cstdint>
#include <future>
#include <vector>

#include "ros/tf/fixed_frame.h"
#include "us_ct_registration/alignment/alignment_decisions.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"
#include "us_ct_registration/volume/volume.h"

namespace usct::ros_interface {

/// A stretch of time between two jumps of the clock back, as at the start of each loop of a bag.
struct ClockEpoch {
  int number = 0;
  /// The clock at its beginning; 0: that of the node.
  ::ros::Time begin;
};

struct HeldCt {
  /// The stamp is the first under which these voxels arrived without others in between.
  std_msgs::Header header;
  /// The epoch of the same arrival.
  ClockEpoch epoch;
  std::uint32_t revision = 0;
  std::uint32_t crc32 = 0;
  CtVolume volume;
};

inline CtIdentity identity_of(const HeldCt& ct) { return {ct.header.frame_id, ct.crc32}; }
/// Compares all voxels: two CTs of one identity might differ.
bool has_same_voxels(const HeldCt& a, const HeldCt& b);

struct HeldUltrasound {
  std_msgs::Header header;
  /// Once the volume is available, each frame is where the probe was at the frame's stamp.
  BeamUltrasound beams;
  FixedPose pose;
  /// Longest way of a sample by the motion of the ultrasound's frame during the sweep, mm.
  double sweep_motion_mm = 0.0;
  std::vector<::ros::Time> frame_stamps;
  /// The epoch in which it arrived.
  ClockEpoch epoch;
  /// Time at which waiting for tf ends.
  std::chrono::steady_clock::time_point tf_deadline;
  /// Whether the probe stood still around the stamp (StillnessWatch).
  std::shared_future<bool> still;
};

/// Whether the ultrasound was acquired before the CT was there, so that it may show another
/// patient. A stamp tells this only until the clock is set back; what arrives after that, and was
/// acquired after that, was acquired with the CT.
bool is_older(const HeldUltrasound& us, const HeldCt& ct);

}  // namespace usct::ros_interface
