#include "ros/alignment/alignment_broadcaster.h"

#include <algorithm>
#include <vector>

#include "ros/conversions/alignment.h"
#include "ros/conversions/times.h"
#include "ros/node/guarded_queue.h"

namespace usct::ros_interface {
namespace {

/// The time as Python's listeners keep it, s.
double as_python_has_it(const ::ros::Time& time) { return time.sec + time.nsec / 1e9; }

/// The least stamp after another one. Python's listeners keep stamps as double numbers of seconds,
/// which are 0.24 us apart today. A second transform of a stamp is dropped there, so that the two
/// must not be the same number. They are neighbours: tf would interpolate between two stamps, and
/// no look-up from Python can lie between these.
::ros::Time next_after(const ::ros::Time& stamp) {
  ::ros::Time next = stamp;
  do next += ::ros::Duration(0, 1);
  while (as_python_has_it(next) == as_python_has_it(stamp));
  return next;
}

/// Whether two alignments are the same transform.
bool same_transform(const std::optional<Alignment>& a, const std::optional<Alignment>& b) {
  if (!a || !b) return !a && !b;
  return a->fixed_frame == b->fixed_frame && a->ct_frame == b->ct_frame &&
         a->T_fixed_ct == b->T_fixed_ct;
}

}  // namespace

AlignmentBroadcaster::AlignmentBroadcaster(const ::ros::NodeHandle& node, const Options& options,
                                           TfWatch& watch)
    : watch_(watch),
      tolerance_(options.tolerance_s),
      node_(with_queue(node, guarded_)),
      spinner_(1, &queue_) {
  timer_ = node_.createTimer(::ros::Duration(1.0 / options.rate_hz),
                             guarded([this](const ::ros::TimerEvent&) { broadcast(false); }));
  // The timer above follows simulated time, which stands still once a bag has ended. Late
  // subscribers must get the transform as well.
  still_clock_timer_ = node_.createWallTimer(
      ::ros::WallDuration(1.0),
      guarded([this](const ::ros::WallTimerEvent&) { broadcast_if_clock_stands(); }));
  spinner_.start();
}

::ros::Time AlignmentBroadcaster::show(const std::optional<Alignment>& alignment) {
  ::ros::Time last_of_other;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (same_transform(alignment, alignment_)) return last_of_other;
    alignment_ = alignment;
    is_new_ = true;
    last_of_other = last_stamp_;
  }
  broadcast(false);
  return last_of_other;
}

geometry_msgs::TransformStamped AlignmentBroadcaster::stamped(const ::ros::Time& stamp) const {
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = stamp;
  transform.header.frame_id = alignment_->fixed_frame;
  transform.child_frame_id = alignment_->ct_frame;
  transform.transform = to_message(alignment_->T_fixed_ct);
  return transform;
}

void AlignmentBroadcaster::broadcast(bool clock_stands) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const ::ros::Time now = ::ros::Time::now();
  if (now.isZero()) return;  // simulated time has not begun
  if (now < last_now_) {
    ROS_WARN("time jumped back by %.3f s", seconds_between(now, last_now_));
    last_stamp_ = ::ros::Time();  // listeners forget what they have
    is_new_ = true;
  }
  last_now_ = now;
  if (!alignment_) return;
  std::vector<::ros::Time> stamps;
  if (is_new_ && !last_stamp_.isZero()) stamps.push_back(next_after(last_stamp_));
  if (is_new_ && now > next_after(last_stamp_)) stamps.push_back(now);
  const ::ros::Time earliest = next_after(stamps.empty() ? last_stamp_ : stamps.back());
  const ::ros::Time regular = now + tolerance_;
  if (regular >= earliest || is_new_ || clock_stands) stamps.push_back(std::max(regular, earliest));
  std::vector<geometry_msgs::TransformStamped> transforms;
  for (const ::ros::Time& stamp : stamps) {
    transforms.push_back(stamped(stamp));
    watch_.sent(transforms.back());
    last_stamp_ = stamp;
  }
  is_new_ = false;
  if (!transforms.empty()) broadcaster_.sendTransform(transforms);
}

void AlignmentBroadcaster::broadcast_if_clock_stands() {
  const ::ros::Time now = ::ros::Time::now();
  bool clock_stands = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    clock_stands = now == clock_at_check_;
    clock_at_check_ = now;
  }
  if (clock_stands) broadcast(true);
}

}  // namespace usct::ros_interface
