#pragma once

#include <ros/ros.h>

namespace usct::ros_interface {

inline const ::ros::Duration kLimit(60.0);

/// Waits until the condition holds; false if it does not within `kLimit`.
template <typename Condition>
bool eventually(Condition&& condition) {
  const ::ros::WallTime end = ::ros::WallTime::now() + ::ros::WallDuration(kLimit.toSec());
  while (::ros::ok() && ::ros::WallTime::now() < end) {
    if (condition()) return true;
    ::ros::WallDuration(0.01).sleep();
  }
  return false;
}

}  // namespace usct::ros_interface
