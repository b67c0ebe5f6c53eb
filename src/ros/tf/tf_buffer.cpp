#include "ros/tf/tf_buffer.h"

#include <tf2/exceptions.h>

#include <algorithm>

#include "ros/conversions/poses.h"
#include "ros/conversions/times.h"
#include "ros/tf/frame_name.h"

namespace usct::ros_interface {

TfBuffer::TfBuffer(const ::ros::Duration& history, double max_gap_s)
    : max_gap_s_(max_gap_s), tf_(history), gaps_(max_gap_s, history.toSec()) {}

bool TfBuffer::set_transform(const geometry_msgs::TransformStamped& transform,
                             const std::string& sender, bool is_static) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!tf_.setTransform(transform, sender, is_static)) return false;
  if (!is_static) gaps_.heard(frame_name(transform.child_frame_id), transform.header.stamp);
  return true;
}

void TfBuffer::clear() {
  const std::lock_guard<std::mutex> lock(mutex_);
  tf_.clear();
  gaps_.clear();
}

std::string TfBuffer::parent_of(const std::string& frame, const ::ros::Time& stamp) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::string parent;
  return tf_._getParent(frame, stamp, parent) ? parent : "";
}

/// The frame, its parent, and so on. tf2 knows them where it can transform the frame.
std::vector<std::string> TfBuffer::with_ancestors(std::string frame,
                                                  const ::ros::Time& stamp) const {
  std::vector<std::string> frames;
  // Above the frames that are asked for there may be a loop.
  while (std::find(frames.begin(), frames.end(), frame) == frames.end()) {
    frames.push_back(frame);
    if (!tf_._getParent(frames.back(), stamp, frame)) break;
  }
  return frames;
}

bool TfBuffer::stood_still(const std::string& frame, const std::string& parent,
                           const TfGap& gap) const try {
  constexpr double kStillMm = 1.0;
  constexpr double kStillRad = 0.01;
  const auto at = [&](const ::ros::Time& stamp) {
    return from_message_mm(tf_.lookupTransform(parent, frame, stamp).transform, "tf");
  };
  const Eigen::Isometry3d motion = at(gap.begin).inverse() * at(gap.end);
  return motion.translation().norm() <= kStillMm &&
         Eigen::AngleAxisd(motion.linear()).angle() <= kStillRad;
} catch (const std::exception&) {  // an end of the gap is no longer known
  return false;
}

/// Describes a gap in the transforms that lead from `source` to `target`; empty: there is none.
std::string TfBuffer::gap_at(const std::string& target, const std::string& source,
                             const ::ros::Time& stamp) const {
  if (max_gap_s_ == 0.0) return {};
  std::vector<std::string> frames = with_ancestors(source, stamp);
  std::vector<std::string> others = with_ancestors(target, stamp);
  while (!frames.empty() && !others.empty() && frames.back() == others.back()) {
    frames.pop_back();
    others.pop_back();
  }
  frames.insert(frames.end(), others.begin(), others.end());
  for (const std::string& frame : frames) {
    const std::optional<TfGap> gap = gaps_.find(frame, stamp);
    std::string parent;
    if (gap && tf_._getParent(frame, stamp, parent) && !stood_still(frame, parent, *gap))
      return "tf had no transform from '" + frame + "' to '" + parent + "' for " +
             seconds_text(seconds_between(gap->begin, gap->end)) + " s, from " +
             seconds_text(gap->begin) + " to " + seconds_text(gap->end) +
             ", and no pose is interpolated over more than " + seconds_text(max_gap_s_) +
             " s (max_tf_gap)";
  }
  return {};
}

bool TfBuffer::can_transform(const std::string& target, const std::string& source,
                             const ::ros::Time& stamp, std::string* why_not) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!tf_.canTransform(target, source, stamp, why_not)) return false;
  const std::string gap = stamp.isZero() ? "" : gap_at(target, source, stamp);
  if (why_not != nullptr) *why_not += gap;
  return gap.empty();
}

geometry_msgs::TransformStamped TfBuffer::look_up(const std::string& target,
                                                  const std::string& source,
                                                  const ::ros::Time& stamp) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const geometry_msgs::TransformStamped found = tf_.lookupTransform(target, source, stamp);
  const std::string gap = gap_at(target, source, found.header.stamp);
  if (!gap.empty()) throw tf2::ExtrapolationException(gap);
  return found;
}

}  // namespace usct::ros_interface
