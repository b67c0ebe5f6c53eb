#include "ros/tf/fixed_frame.h"

#include <tf2/exceptions.h>

#include <algorithm>
#include <cmath>

#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"
#include "ros/node/refusal.h"
#include "ros/tf/tf_buffer.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/geometry/probe_motion.h"

namespace usct::ros_interface {
namespace {

using Status = us_ct_registration::StatusCode;
using Eigen::Isometry3d;

constexpr double kDegPerRad = 57.29577951308232;

std::string quoted(const std::string& frame) { return "'" + frame + "'"; }

std::string at(const ::ros::Time& stamp) {
  return " at the ultrasound's stamp " + seconds_text(stamp);
}

Isometry3d transform_mm(const TfBuffer& tf, const std::string& target, const std::string& source,
                        const ::ros::Time& time) {
  return from_message_mm(tf.look_up(target, source, time).transform,
                         "tf from " + quoted(source) + " to " + quoted(target));
}

}  // namespace

FixedFrame::FixedFrame(const TfBuffer& tf, FixedFrameOptions options)
    : tf_(tf), options_(std::move(options)) {}

const std::string& FixedFrame::name(const std_msgs::Header& us) const {
  return options_.frame.empty() ? us.frame_id : options_.frame;
}

bool FixedFrame::reaches(const std_msgs::Header& us) const {
  return is_own_frame(us) || tf_.can_transform(name(us), us.frame_id, us.stamp);
}

bool FixedFrame::is_complete(const std_msgs::Header& us) const {
  return is_own_frame(us) ||
         tf_.can_transform(name(us), us.frame_id, shifted(us.stamp, options_.jump_window_s));
}

FixedPose FixedFrame::look_up(const std_msgs::Header& us) const {
  if (is_own_frame(us)) return {};
  FixedPose pose;
  try {
    const ::ros::Time time = usable_time(us);
    pose.T_fixed_us = T_fixed_us_at(us, time);
    pose.age_s = seconds_between(time, us.stamp);
    require_still(us, pose);
  } catch (const Refusal&) {
    throw;
  } catch (const std::exception& error) {
    unavailable(us, error);
  }
  return pose;
}

void FixedFrame::unavailable(const std_msgs::Header& us, const std::exception& error) const {
  throw Refusal(Status::TF_UNAVAILABLE, "tf does not connect " + quoted(us.frame_id) + " to " +
                                            quoted(name(us)) + at(us.stamp) + ": " + error.what());
}

Isometry3d FixedFrame::T_fixed_us_at(const std_msgs::Header& us, const ::ros::Time& time) const {
  return transform_mm(tf_, name(us), us.frame_id, time);
}

::ros::Time FixedFrame::usable_time(const std_msgs::Header& us) const {
  std::string why;
  if (tf_.can_transform(name(us), us.frame_id, us.stamp, &why)) return us.stamp;
  // This throws if the frames were never connected.
  const ::ros::Time newest = tf_.look_up(name(us), us.frame_id, ::ros::Time(0)).header.stamp;
  if (newest >= us.stamp) throw tf2::ExtrapolationException(why);
  const double age_s = seconds_between(newest, us.stamp);
  if (age_s > options_.max_tf_age_s)
    throw Refusal(Status::TF_STALE,
                  "the newest transform from " + quoted(us.frame_id) + " to " + quoted(name(us)) +
                      " has the stamp " + seconds_text(newest) + ", " + seconds_text(age_s) +
                      " s before the ultrasound's stamp " + seconds_text(us.stamp) +
                      "; allowed (max_tf_age): " + seconds_text(options_.max_tf_age_s) + " s");
  return newest;
}

void FixedFrame::require_still(const std_msgs::Header& us, const FixedPose& pose) const try {
  if (is_own_frame(us)) return;
  constexpr int kSamples = 4;  // on either side
  for (int i = -kSamples; i <= kSamples; ++i) {
    const double offset_s = options_.jump_window_s * i / kSamples;
    const ::ros::Time time = shifted(us.stamp, offset_s);
    // tf takes the time 0 for the newest transform.
    if (i == 0 || time.isZero()) continue;
    if (!tf_.can_transform(name(us), us.frame_id, time)) continue;
    require_small(us, pose.T_fixed_us.inverse() * T_fixed_us_at(us, time), time, us.stamp);
  }
} catch (const Refusal&) {
  throw;
} catch (const std::exception& error) {
  unavailable(us, error);
}

void FixedFrame::require_small(const std_msgs::Header& us, const Isometry3d& T_us_moved,
                               const ::ros::Time& from, const ::ros::Time& to) const {
  const double moved_mm = T_us_moved.translation().norm();
  const double turned_deg = kDegPerRad * Eigen::AngleAxisd(T_us_moved.rotation()).angle();
  if (moved_mm <= options_.max_jump_mm && turned_deg <= options_.max_jump_deg) return;
  throw Refusal(
      Status::TF_JUMPED,
      quoted(us.frame_id) + " in " + quoted(name(us)) +
          formatted(" moved by %.1f mm and %.1f degrees between %.3f s and %.3f s; allowed: %g "
                    "mm, %g degrees",
                    moved_mm, turned_deg, from.toSec(), to.toSec(), options_.max_jump_mm,
                    options_.max_jump_deg));
}

std::vector<Isometry3d> FixedFrame::T_us_then(const std_msgs::Header& us, const FixedPose& pose,
                                              const std::vector<::ros::Time>& stamps) const try {
  std::vector<Isometry3d> poses(stamps.size(), Isometry3d::Identity());
  if (is_own_frame(us)) return poses;
  const ::ros::Time last = shifted(us.stamp, -pose.age_s);
  for (std::size_t i = 0; i < stamps.size(); ++i)
    poses[i] = pose.T_fixed_us.inverse() * T_fixed_us_at(us, std::min(stamps[i], last));
  return poses;
} catch (const std::exception& error) {
  throw Refusal(Status::TF_UNAVAILABLE,
                "tf does not connect " + quoted(us.frame_id) + " to " + quoted(name(us)) +
                    " at the stamp of each frame of the sweep, so that a motion of the probe "
                    "during the sweep would not be noticed: " +
                    error.what());
}

double FixedFrame::compensate(const std_msgs::Header& us, const FixedPose& pose,
                              const std::vector<::ros::Time>& stamps, BeamGrid& beams) const {
  // Rounding, and the noise of a tracker at rest, leave the beams bit by bit as they are.
  constexpr double kAtRestMm = 0.01;
  if (is_own_frame(us)) return 0.0;
  if (stamps.empty()) {
    // The poses of a tracked sweep then are those at the stamp of the volume.
    if (!beams.tracked) require_still_before(us, pose);
    return 0.0;
  }
  const std::vector<Isometry3d> poses = T_us_then(us, pose, stamps);
  const double motion_mm = probe_motion_mm(beams, poses);
  if (motion_mm > options_.max_sweep_motion_mm) {
    throw Refusal(
        Status::TF_JUMPED,
        quoted(us.frame_id) + " in " + quoted(name(us)) +
            formatted(" moved during the sweep, from %.3f s to %.3f s, and a sample by %.1f mm "
                      "with it; allowed (max_sweep_motion_mm): %g mm",
                      stamps.front().toSec(), us.stamp.toSec(), motion_mm,
                      options_.max_sweep_motion_mm));
  }
  for (std::size_t i = 1; i < poses.size(); ++i)
    require_small(us, poses[i - 1].inverse() * poses[i], stamps[i - 1], stamps[i]);
  if (motion_mm > kAtRestMm) follow_probe(poses, beams);
  return motion_mm;
}

void FixedFrame::require_still_before(const std_msgs::Header& us, const FixedPose& pose) const {
  constexpr double kStepS = 0.05;
  const int steps = static_cast<int>(std::ceil(options_.sweep_duration_s / kStepS));
  std::vector<::ros::Time> times;
  for (int i = 1; i <= steps; ++i) {
    const ::ros::Time time = shifted(us.stamp, -options_.sweep_duration_s * i / steps);
    if (!time.isZero()) times.push_back(time);
  }
  try {
    const std::vector<Isometry3d> poses = T_us_then(us, pose, times);
    for (std::size_t i = 0; i < times.size(); ++i) require_small(us, poses[i], times[i], us.stamp);
  } catch (const Refusal& refusal) {
    throw Refusal(refusal.code(), std::string(refusal.what()) +
                                      "; the volume has no 'frame_stamps', and may have taken " +
                                      seconds_text(options_.sweep_duration_s) +
                                      " s (sweep_duration)");
  }
}

Isometry3d FixedFrame::T_us_frame(const std_msgs::Header& us, const FixedPose& pose,
                                  const std::string& frame) const {
  if (frame.empty())
    throw Refusal(Status::INVALID_REQUEST, "the frame_id of the initial alignment is empty");
  if (frame == us.frame_id) return Isometry3d::Identity();
  if (frame == name(us)) return pose.T_fixed_us.inverse();
  try {
    return transform_mm(tf_, us.frame_id, frame, us.stamp);
  } catch (const std::exception& error) {
    throw Refusal(Status::TF_UNAVAILABLE, "tf does not connect " + quoted(frame) +
                                              ", the frame of the initial alignment, to " +
                                              quoted(us.frame_id) + at(us.stamp) + ": " +
                                              error.what());
  }
}

}  // namespace usct::ros_interface
