#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <functional>
#include <string>

namespace usct::ros_interface {

/// A topic on which nothing has arrived, and the type of its messages.
struct ExpectedTopic {
  std::string name;      // resolved
  std::string datatype;  // package/Type
  std::string md5sum;
};

/// Says in words why nothing has arrived: the topic has no publisher, or one of another type, or
/// one whose message definition differs (it was built against other .msg files; ROS then makes no
/// connection and says so only in the log), or one that has sent nothing.
///
/// If `subscriber` is not connected, it is shut down for the time of the check, and `resubscribe`
/// makes a new one. Takes up to two seconds, or until `cancelled`.
std::string why_nothing_arrived(const ::ros::NodeHandle& node, const ExpectedTopic& expected,
                                ::ros::Subscriber& subscriber,
                                const std::function<::ros::Subscriber()>& resubscribe,
                                const std::function<bool()>& cancelled);

}  // namespace usct::ros_interface
