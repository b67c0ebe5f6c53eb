#pragma once

#include <ros/time.h>

#include <cstdint>

/// Times between the core (nanoseconds since 1970) and messages.
namespace usct::ros_interface {

inline std::int64_t nanoseconds_from(const ::ros::Time& time) {
  return static_cast<std::int64_t>(time.toNSec());
}

inline ::ros::Time time_from(std::int64_t nanoseconds) {
  return ::ros::Time().fromNSec(static_cast<std::uint64_t>(nanoseconds));
}

}  // namespace usct::ros_interface
