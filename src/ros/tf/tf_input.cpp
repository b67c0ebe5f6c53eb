#include "ros/tf/tf_input.h"

#include <ros/console.h>

#include <algorithm>

#include "ros/conversions/times.h"
#include "ros/tf/tf_buffer.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

constexpr unsigned kQueue = 100;  // as of tf2_ros

}  // namespace

TfInput::TfInput(TfBuffer& buffer, const ::ros::NodeHandle& node)
    : buffer_(buffer), node_(with_queue(node, guarded_)), spinner_(1, &queue_) {
  moving_ = node_.subscribe("/tf", kQueue, &TfInput::take_moving, this);
  static_ = node_.subscribe("/tf_static", kQueue, &TfInput::take_static, this);
  spinner_.start();
}

void TfInput::notice_time(const ::ros::Time& now) {
  if (ran_back(now, last_now_)) {
    ROS_WARN("time ran back by %.3f s: tf is forgotten", seconds_between(now, last_now_));
    buffer_.clear();
    last_now_ = now;
  }
  last_now_ = std::max(last_now_, now);
}

void TfInput::take(const Event& event, bool is_static) {
  const ::ros::Time now = ::ros::Time::now();
  notice_time(now);
  const std::string sender = event.getPublisherName();
  for (const geometry_msgs::TransformStamped& transform : event.getConstMessage()->transforms) {
    try {
      if (!is_static)
        require_not_ahead(transform.header.stamp, now,
                          "transform from '" + transform.header.frame_id + "' to '" +
                              transform.child_frame_id + "' of " + sender,
                          "header.stamp");
      buffer_.set_transform(transform, sender, is_static);
    } catch (const std::exception& error) {
      ROS_ERROR_THROTTLE(1.0, "tf: %s", error.what());
    }
  }
}

}  // namespace usct::ros_interface
