#include "ros/fixed_frame.h"

#include <cmath>
#include <cstdio>

#include "ros/conversions/poses.h"
#include "ros/refusal.h"

namespace usct::ros_interface {
namespace {

using Status = us_ct_registration::StatusCode;
using Eigen::Isometry3d;

constexpr double kDegPerRad = 57.29577951308232;

std::string quoted(const std::string& frame) { return "'" + frame + "'"; }

std::string at(const ::ros::Time& stamp) {
  return " at the ultrasound's stamp " + seconds_text(stamp);
}

Isometry3d transform_mm(const tf2::BufferCore& tf, const std::string& target,
                        const std::string& source, const ::ros::Time& time) {
  return from_message_mm(tf.lookupTransform(target, source, time).transform,
                         "tf from " + quoted(source) + " to " + quoted(target));
}

}  // namespace

std::string seconds_text(double seconds) {
  char text[64];
  std::snprintf(text, sizeof text, "%.3f", seconds);
  return text;
}

std::string seconds_text(const ::ros::Time& time) { return seconds_text(time.toSec()); }

FixedFrame::FixedFrame(const tf2::BufferCore& tf, FixedFrameOptions options)
    : tf_(tf), options_(std::move(options)) {}

const std::string& FixedFrame::name(const std_msgs::Header& us) const {
  return options_.frame.empty() ? us.frame_id : options_.frame;
}

bool FixedFrame::reaches(const std_msgs::Header& us) const {
  return is_own_frame(us) || tf_.canTransform(name(us), us.frame_id, us.stamp);
}

bool FixedFrame::is_complete(const std_msgs::Header& us) const {
  return is_own_frame(us) || tf_.canTransform(name(us), us.frame_id,
                                              us.stamp + ::ros::Duration(options_.jump_window_s));
}

FixedPose FixedFrame::look_up(const std_msgs::Header& us) const {
  if (is_own_frame(us)) return {};
  FixedPose pose;
  try {
    const ::ros::Time time = usable_time(us);
    pose.T_fixed_us = T_fixed_us_at(us, time);
    pose.age_s = (us.stamp - time).toSec();
    require_still(us, pose);
  } catch (const tf2::TransformException& error) {
    unavailable(us, error);
  }
  return pose;
}

void FixedFrame::unavailable(const std_msgs::Header& us,
                             const tf2::TransformException& error) const {
  throw Refusal(Status::TF_UNAVAILABLE, "tf does not connect " + quoted(us.frame_id) + " to " +
                                            quoted(name(us)) + at(us.stamp) + ": " + error.what());
}

Isometry3d FixedFrame::T_fixed_us_at(const std_msgs::Header& us, const ::ros::Time& time) const {
  return transform_mm(tf_, name(us), us.frame_id, time);
}

::ros::Time FixedFrame::usable_time(const std_msgs::Header& us) const {
  std::string why;
  if (tf_.canTransform(name(us), us.frame_id, us.stamp, &why)) return us.stamp;
  // This throws if the frames were never connected.
  const ::ros::Time newest =
      tf_.lookupTransform(name(us), us.frame_id, ::ros::Time(0)).header.stamp;
  if (newest >= us.stamp) throw tf2::ExtrapolationException(why);
  const double age_s = (us.stamp - newest).toSec();
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
    const ::ros::Duration offset(options_.jump_window_s * i / kSamples);
    // tf takes the time 0 for the newest transform.
    if (i == 0 || us.stamp.toSec() + offset.toSec() <= 0.0) continue;
    if (!tf_.canTransform(name(us), us.frame_id, us.stamp + offset)) continue;
    const Isometry3d moved = T_fixed_us_at(us, us.stamp + offset);
    const double moved_mm = (moved.translation() - pose.T_fixed_us.translation()).norm();
    const double turned_deg =
        kDegPerRad * Eigen::AngleAxisd((pose.T_fixed_us.inverse() * moved).rotation()).angle();
    if (moved_mm <= options_.max_jump_mm && turned_deg <= options_.max_jump_deg) continue;
    char text[200];
    std::snprintf(text, sizeof text,
                  " moved by %.1f mm and %.1f degrees between %+.3f s and the ultrasound's stamp "
                  "%.3f; allowed: %g mm, %g degrees",
                  moved_mm, turned_deg, offset.toSec(), us.stamp.toSec(), options_.max_jump_mm,
                  options_.max_jump_deg);
    throw Refusal(Status::TF_JUMPED, quoted(us.frame_id) + " in " + quoted(name(us)) + text);
  }
} catch (const tf2::TransformException& error) {
  unavailable(us, error);
}

Isometry3d FixedFrame::T_us_frame(const std_msgs::Header& us, const FixedPose& pose,
                                  const std::string& frame) const {
  if (frame.empty())
    throw Refusal(Status::INVALID_REQUEST, "the frame_id of the initial alignment is empty");
  if (frame == us.frame_id) return Isometry3d::Identity();
  if (frame == name(us)) return pose.T_fixed_us.inverse();
  try {
    return transform_mm(tf_, us.frame_id, frame, us.stamp);
  } catch (const tf2::TransformException& error) {
    throw Refusal(Status::TF_UNAVAILABLE, "tf does not connect " + quoted(frame) +
                                              ", the frame of the initial alignment, to " +
                                              quoted(us.frame_id) + at(us.stamp) + ": " +
                                              error.what());
  }
}

}  // namespace usct::ros_interface
