#include "ros/alignment/alignment_watch.h"

#include <ros/console.h>
#include <us_ct_registration/StatusCode.h>

#include "ros/conversions/alignment.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"
#include "ros/node/refusal.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

/// The pose that the alignment gives the CT; empty if there is no alignment, or no valid pose.
std::optional<AlignedCt> aligned_by(const msg::Alignment& alignment) try {
  const std::optional<Eigen::Isometry3d> T_fixed_ct = T_fixed_ct_from(alignment);
  if (!T_fixed_ct) return std::nullopt;
  return AlignedCt{alignment.header.frame_id, alignment.ct_frame, *T_fixed_ct};
} catch (const InputError&) {
  return std::nullopt;
}

bool is_same(const std::optional<AlignedCt>& a, const std::optional<AlignedCt>& b) {
  if (!a || !b) return !a && !b;
  return a->fixed_frame == b->fixed_frame && a->ct_frame == b->ct_frame &&
         a->T_fixed_ct.matrix() == b->T_fixed_ct.matrix();
}

/// Why tf does not have the alignment at the present time; empty if it has.
std::string why_missing(const TfBuffer& tf, const AlignedCt& aligned, const ::ros::Time& now) try {
  if (now.isZero()) return "simulated time has not begun";  // tf would give its newest transform
  T_fixed_ct_in_tf(tf, aligned, now);
  return "";
} catch (const Refusal&) {
  return "tf has the CT where another alignment has it";
} catch (const std::exception&) {  // its words name the time, which differs at each look-up
  return "tf does not connect '" + aligned.ct_frame + "' to '" + aligned.fixed_frame +
         "' at the present time";
}

}  // namespace

Eigen::Isometry3d T_fixed_ct_in_tf(const TfBuffer& tf, const AlignedCt& aligned,
                                   const ::ros::Time& stamp) {
  constexpr double kSameMm = 1e-3;
  constexpr double kSameRad = 1e-6;
  const Eigen::Isometry3d T_fixed_ct =
      from_message_mm(tf.look_up(aligned.fixed_frame, aligned.ct_frame, stamp).transform, "tf");
  const Eigen::Isometry3d difference = aligned.T_fixed_ct.inverse() * T_fixed_ct;
  if (difference.translation().norm() > kSameMm ||
      Eigen::AngleAxisd(difference.linear()).angle() > kSameRad)
    throw Refusal(msg::StatusCode::TF_STALE, "at the stamp " + seconds_text(stamp) +
                                                 " tf has the CT where another alignment has it");
  return T_fixed_ct;
}

void AlignmentWatch::arrived(const msg::Alignment& alignment) {
  const std::optional<AlignedCt> aligned = aligned_by(alignment);
  if (is_same(aligned, aligned_)) return;
  aligned_ = aligned;
  missing_since_.reset();
  problem_.clear();
}

bool AlignmentWatch::look_up(const TfBuffer& tf, const ::ros::Time& now,
                             Clock::time_point wall_now) {
  const std::string why = aligned_ ? why_missing(tf, *aligned_, now) : "";
  if (why.empty())
    missing_since_.reset();
  else if (!missing_since_)
    missing_since_ = wall_now;
  const bool is_missed = missing_since_ && wall_now - *missing_since_ >= kPatience;
  const std::string problem = is_missed ? "the accepted alignment is not in force: " + why : "";
  const bool is_changed = problem != problem_;
  if (is_changed && is_missed) ROS_WARN("%s", problem.c_str());
  problem_ = problem;
  return is_changed;
}

}  // namespace usct::ros_interface
