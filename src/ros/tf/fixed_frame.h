#pragma once

#include <ros/time.h>
#include <std_msgs/Header.h>

#include <Eigen/Geometry>
#include <exception>
#include <string>
#include <vector>

#include "ros/tf/tf_buffer.h"
#include "us_ct_registration/geometry/beam_grid.h"

namespace usct::ros_interface {

struct FixedFrameOptions {
  /// Name of the frame that stays with the patient; empty: the ultrasound's own frame.
  std::string frame;
  /// If tf has no transform at the ultrasound's stamp yet, the newest one is used in its place, as
  /// long as it is no older than this, s; 0: never.
  double max_tf_age_s = 0.0;
  /// Largest motion of the ultrasound's frame within `jump_window_s` before and after the stamp.
  double jump_window_s = 0.1;
  double max_jump_mm = 3.0;
  double max_jump_deg = 3.0;
  /// Largest way of a sample by the motion of the ultrasound's frame during the sweep, which is
  /// compensated; >= 0.
  double max_sweep_motion_mm = 10.0;
  /// Longest time that a motorised sweep without `frame_stamps` may have taken. Over this time
  /// before its stamp, the ultrasound's frame may move by `max_jump_mm` and `max_jump_deg`; >= 0.
  double sweep_duration_s = 5.0;
};

/// Pose of the ultrasound's frame in the fixed frame at the stamp of the ultrasound.
struct FixedPose {
  Eigen::Isometry3d T_fixed_us = Eigen::Isometry3d::Identity();
  /// Age of the transform relative to the stamp, s; 0 unless older transforms are allowed.
  double age_s = 0.0;
};

/// Looks the poses of the ultrasound's frame up in tf. A pose that tf does not know is a Refusal
/// with frames, stamps and ages, and never the identity.
class FixedFrame {
 public:
  FixedFrame(const TfBuffer& tf, FixedFrameOptions options);

  /// Name of the fixed frame of an ultrasound volume.
  const std::string& name(const std_msgs::Header& us) const;
  /// Whether `frame` is the fixed frame of every ultrasound volume.
  bool is_fixed(const std::string& frame) const {
    return !frame.empty() && frame == options_.frame;
  }

  /// Whether tf reaches the stamp, so that `look_up` has nothing to wait for.
  bool reaches(const std_msgs::Header& us) const;
  /// Whether tf reaches the end of the window after the stamp, so that `require_still` has nothing
  /// to wait for.
  bool is_complete(const std_msgs::Header& us) const;
  /// The pose at the stamp. Refuses with TF_UNAVAILABLE, TF_STALE or, as far as tf reaches,
  /// TF_JUMPED.
  FixedPose look_up(const std_msgs::Header& us) const;
  /// Refuses with TF_JUMPED if the ultrasound's frame moved within the window, as far as tf
  /// reaches, and with TF_UNAVAILABLE if tf has forgotten the frame.
  void require_still(const std_msgs::Header& us, const FixedPose& pose) const;

  /// Poses of the ultrasound's frame at the `stamps` of the frames of a sweep, in the ultrasound's
  /// frame at the stamp of the header, mm (`T_us_then` of probe_motion.h). Where `pose` is older
  /// than the header's stamp, later stamps get the pose at its time. Refuses with TF_UNAVAILABLE.
  std::vector<Eigen::Isometry3d> T_us_then(const std_msgs::Header& us, const FixedPose& pose,
                                           const std::vector<::ros::Time>& stamps) const;
  /// Sets each frame of a sweep where the ultrasound's frame was at the frame's stamp, and returns
  /// the longest way of a sample by that, mm. Without stamps, a motorised sweep is left as it is,
  /// and the ultrasound's frame must have stood still for `sweep_duration_s`. Refuses with
  /// TF_UNAVAILABLE, or with TF_JUMPED for more motion than is allowed.
  double compensate(const std_msgs::Header& us, const FixedPose& pose,
                    const std::vector<::ros::Time>& stamps, BeamGrid& beams) const;

  /// The pose of any frame in the ultrasound's frame, at the ultrasound's stamp. Refuses with
  /// TF_UNAVAILABLE, or with INVALID_REQUEST if the name is empty.
  Eigen::Isometry3d T_us_frame(const std_msgs::Header& us, const FixedPose& pose,
                               const std::string& frame) const;

 private:
  bool is_own_frame(const std_msgs::Header& us) const { return name(us) == us.frame_id; }
  void require_still_before(const std_msgs::Header& us, const FixedPose& pose) const;
  void require_small(const std_msgs::Header& us, const Eigen::Isometry3d& T_us_moved,
                     const ::ros::Time& from, const ::ros::Time& to) const;
  Eigen::Isometry3d T_fixed_us_at(const std_msgs::Header& us, const ::ros::Time& time) const;
  ::ros::Time usable_time(const std_msgs::Header& us) const;
  [[noreturn]] void unavailable(const std_msgs::Header& us, const std::exception& error) const;

  const TfBuffer& tf_;
  const FixedFrameOptions options_;
};

}  // namespace usct::ros_interface
