#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/scan_geometry.h"

namespace usct {

/// Pose of a tracked frame.
struct FramePose {
  /// Maps frame coordinates to the US frame, mm.
  Eigen::Isometry3d T_us_frame = Eigen::Isometry3d::Identity();
  /// Name of the US frame.
  std::string us_frame_id;
  /// True: the sender measured the pose at the frame's stamp. If images lag poses, the image shows
  /// an earlier time. False: the pose was looked up at the stamp minus the lag.
  bool at_stamp = true;
};

/// Motion of the motor of a motorised probe during a frame.
struct MotorFrame {
  double motor_radius_mm = 0.0;
  /// Motor angle at the middle of the frame.
  double angle_rad = 0.0;
  /// Travel from the first line of the frame to the last; negative when the motor runs back.
  double travel_rad = 0.0;
};

/// One 2D frame of a stream, before scan conversion.
struct StreamedFrame {
  /// Number of the sweep that the frame belongs to, counted by the sender.
  std::uint32_t sweep = 0;
  /// Index of the frame within its sweep, from 0, in the order of acquisition.
  std::uint32_t index = 0;
  /// Number of frames in the sweep; 0: unknown.
  std::uint32_t frames_in_sweep = 0;
  /// Middle of the frame's acquisition, nanoseconds since 1970.
  std::int64_t stamp_ns = 0;
  /// Name of a coordinate frame: the US frame of a motorised probe, or the frame that moves with
  /// the array of a tracked probe.
  std::string frame_id;

  AxialSampling axial;
  Array array;
  /// Set for motorised probes only.
  std::optional<MotorFrame> motor;
  /// Pose, of tracked probes only; empty if it is not known, with the reason in `pose_problem`.
  std::optional<FramePose> pose;
  std::string pose_problem;

  /// Lines x samples, samples fastest. Never null in a valid frame.
  std::shared_ptr<const std::vector<std::uint8_t>> brightness;

  bool is_motorised() const { return motor.has_value(); }
  /// "sweep 3 frame 14".
  std::string name() const;

  /// Throws InputError, naming the frame, unless it is a valid 2D frame: array and samples as in
  /// ScanGeometry, as many brightness values, finite motor numbers, a motor radius > 0, an index
  /// below `frames_in_sweep`, a `frame_id` unless the sender gave the pose, and a stamp that minus
  /// `image_lag_s` lies between 1970 and 2106 (the range of times that messages can hold).
  void validate(double image_lag_s) const;
};

}  // namespace usct
