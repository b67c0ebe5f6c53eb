#pragma once

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <tf2_ros/transform_broadcaster.h>

#include <mutex>
#include <optional>

#include "ros/node/guarded_queue.h"
#include "ros/tf/tf_watch.h"
#include "us_ct_registration/alignment/alignment_decisions.h"

namespace usct::ros_interface {

/// Broadcasts one transform all the time, in the manner of amcl: stamps are post-dated, so that
/// look-ups at the present time succeed between two broadcasts, and fail soon after the program has
/// died. It has a thread of its own, which nothing else can hold up.
///
/// A change of the transform is a step. tf interpolates between stamps, and listeners cannot be
/// made to forget what they have: an alignment therefore begins right after the last stamp of the
/// one before, and look-ups find one or the other, no pose in between.
class AlignmentBroadcaster {
 public:
  struct Options {
    double rate_hz = 20.0;
    /// Time by which stamps are post-dated.
    double tolerance_s = 0.2;
  };

  /// Tells `watch` of each transform. The watch must outlive the broadcaster.
  AlignmentBroadcaster(const ::ros::NodeHandle& node, const Options& options, TfWatch& watch);

  /// Broadcasts this alignment from now on, or none. Returns the last stamp of the one before: once
  /// that has passed, look-ups at the present time find the new one, or fail if it is none. Returns
  /// 0 if there is nothing to wait for.
  ::ros::Time show(const std::optional<Alignment>& alignment);

 private:
  void broadcast(bool clock_stands);
  void broadcast_if_clock_stands();
  geometry_msgs::TransformStamped stamped(const ::ros::Time& stamp) const;

  TfWatch& watch_;
  const ::ros::Duration tolerance_;

  std::mutex mutex_;  // guards the members below, up to clock_at_check_
  std::optional<Alignment> alignment_;
  bool is_new_ = false;  // it was not broadcast yet
  ::ros::Time last_now_;
  ::ros::Time last_stamp_;
  ::ros::Time clock_at_check_;

  ::ros::CallbackQueue queue_;
  GuardedQueue guarded_{queue_};
  ::ros::NodeHandle node_;
  tf2_ros::TransformBroadcaster broadcaster_;
  ::ros::Timer timer_;
  ::ros::WallTimer still_clock_timer_;
  // Last: it is destroyed first, and then no callback runs any more.
  ::ros::AsyncSpinner spinner_;
};

}  // namespace usct::ros_interface
