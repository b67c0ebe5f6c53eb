#pragma once

#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>

namespace usct::ros_interface {

/// The publisher of simulated time. It sends the time only when it is set; nodes that start later
/// get it as well.
class Clock {
 public:
  explicit Clock(::ros::NodeHandle& node)
      : publisher_(node.advertise<rosgraph_msgs::Clock>("/clock", 1, true)) {}

  void set(const ::ros::Time& time) const {
    rosgraph_msgs::Clock message;
    message.clock = time;
    publisher_.publish(message);
  }
  /// Ends as `rosbag play` does with its bag: nobody publishes the time any more.
  void end() { publisher_.shutdown(); }

 private:
  ::ros::Publisher publisher_;
};

}  // namespace usct::ros_interface
