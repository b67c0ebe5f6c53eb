#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <functional>
#include <string>

namespace usct::ros_interface {

/// What is asked of a topic on which nothing has arrived.
struct ExpectedTopic {
  std::string name;      // resolved
  std::string datatype;  // package/Type
  std::string md5sum;
};

/// Why nothing has arrived, in words: no publisher; one of another type; one whose message
/// definition differs (it was built against other .msg files: no connection comes about, and ROS
/// says so only in the log); or one that has sent nothing.
///
/// `resubscribe` subscribes anew; `subscriber` is let go for the time of the check if it is not
/// connected. Takes up to two seconds, or until `cancelled`.
std::string why_nothing_arrived(const ::ros::NodeHandle& node, const ExpectedTopic& expected,
                                ::ros::Subscriber& subscriber,
                                const std::function<::ros::Subscriber()>& resubscribe,
                                const std::function<bool()>& cancelled);

}  // namespace usct::ros_interface
