#pragma once

#include <ros/time.h>
#include <std_msgs/Header.h>
#include <tf2/buffer_core.h>
#include <tf2/exceptions.h>

#include <Eigen/Geometry>
#include <string>

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
  FixedFrame(const tf2::BufferCore& tf, FixedFrameOptions options);

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

  /// The pose of any frame in the ultrasound's frame, at the ultrasound's stamp. Refuses with
  /// TF_UNAVAILABLE, or with INVALID_REQUEST if the name is empty.
  Eigen::Isometry3d T_us_frame(const std_msgs::Header& us, const FixedPose& pose,
                               const std::string& frame) const;

 private:
  bool is_own_frame(const std_msgs::Header& us) const { return name(us) == us.frame_id; }
  Eigen::Isometry3d T_fixed_us_at(const std_msgs::Header& us, const ::ros::Time& time) const;
  ::ros::Time usable_time(const std_msgs::Header& us) const;
  [[noreturn]] void unavailable(const std_msgs::Header& us,
                                const tf2::TransformException& error) const;

  const tf2::BufferCore& tf_;
  const FixedFrameOptions options_;
};

/// Seconds with three decimals, like "1234.567".
std::string seconds_text(const ::ros::Time& time);
std::string seconds_text(double seconds);

}  // namespace usct::ros_interface
