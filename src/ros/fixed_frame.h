#pragma once

#include <ros/time.h>
#include <std_msgs/Header.h>
#include <tf2/buffer_core.h>
#include <tf2/exceptions.h>

#include <Eigen/Geometry>
#include <string>

namespace usct::ros_interface {

struct FixedFrameOptions {
  /// What stays with the patient; empty: the ultrasound's own frame.
  std::string frame;
  /// The newest transform may be older than the ultrasound by this, s, and then counts in place of
  /// the one at the stamp; 0: never.
  double max_tf_age_s = 0.0;
  /// Largest motion of the ultrasound's frame within `jump_window_s` before and after the stamp.
  double jump_window_s = 0.1;
  double max_jump_mm = 3.0;
  double max_jump_deg = 3.0;
};

/// Where the ultrasound's frame was at its stamp.
struct FixedPose {
  Eigen::Isometry3d T_fixed_us = Eigen::Isometry3d::Identity();
  /// How much older than the stamp it is, s; 0 unless that is allowed.
  double age_s = 0.0;
};

/// Poses of the ultrasound's frame by tf. What tf does not know is a Refusal with frames, stamps
/// and ages; never identity.
class FixedFrame {
 public:
  FixedFrame(const tf2::BufferCore& tf, FixedFrameOptions options);

  /// The fixed frame of an ultrasound volume.
  const std::string& name(const std_msgs::Header& us) const;
  /// Whether it is the same frame for every ultrasound volume.
  bool is_fixed(const std::string& frame) const {
    return !frame.empty() && frame == options_.frame;
  }

  /// Whether tf reaches the stamp: `look_up` has nothing to wait for.
  bool reaches(const std_msgs::Header& us) const;
  /// Whether it reaches beyond the window after it: neither has `require_still`.
  bool is_complete(const std_msgs::Header& us) const;
  /// Refuses with TF_UNAVAILABLE, TF_STALE or, as far as tf reaches, TF_JUMPED.
  FixedPose look_up(const std_msgs::Header& us) const;
  /// Refuses with TF_JUMPED where tf says, as far as it reaches, that the ultrasound's frame moved
  /// within the window; with TF_UNAVAILABLE where it has forgotten.
  void require_still(const std_msgs::Header& us, const FixedPose& pose) const;

  /// Any frame in the ultrasound's frame, at its stamp. Refuses with TF_UNAVAILABLE, or
  /// INVALID_REQUEST if the name is empty.
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

/// "1234.567".
std::string seconds_text(const ::ros::Time& time);
std::string seconds_text(double seconds);

}  // namespace usct::ros_interface
