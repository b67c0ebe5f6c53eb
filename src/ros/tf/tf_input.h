#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <tf2_msgs/TFMessage.h>

#include <mutex>
#include <string>

#include "ros/node/guarded_queue.h"
#include "ros/tf/tf_buffer.h"

namespace usct::ros_interface {

/// Fills a tf buffer from `/tf` and `/tf_static`, in a thread of its own, and empties it when time
/// runs back, as tf2_ros::TransformListener does. Unlike that class it drops a transform whose
/// stamp is far ahead of the clock: one such message would end the node with an exception, or make
/// the buffer forget its history, and then refuse all that is older.
class TfInput {
 public:
  /// `buffer` must outlive this object.
  TfInput(TfBuffer& buffer, const ::ros::NodeHandle& node);

 private:
  using Event = ::ros::MessageEvent<tf2_msgs::TFMessage const>;

  void take_moving(const Event& event) { take(event, false); }
  void take_static(const Event& event) { take(event, true); }
  void take(const Event& event, bool is_static);
  void notice_time(const ::ros::Time& now);

  TfBuffer& buffer_;
  ::ros::Time last_now_;  // of the one thread below
  ::ros::CallbackQueue queue_;
  GuardedQueue guarded_{queue_};
  ::ros::NodeHandle node_;
  ::ros::Subscriber moving_;
  ::ros::Subscriber static_;
  ::ros::AsyncSpinner spinner_;  // last: its thread uses the members above
};

}  // namespace usct::ros_interface
