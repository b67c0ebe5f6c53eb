#include "ros/ingest/last_arrival.h"

#include <rosgraph_msgs/Clock.h>

#include "ros/conversions/times.h"

namespace usct::ros_interface {
namespace {

/// ROS itself takes the time; only the number of publishers counts here.
void ignore(const rosgraph_msgs::ClockConstPtr&) {}

}  // namespace

LastArrival::LastArrival(::ros::NodeHandle node) : clock_(node.subscribe("/clock", 1, ignore)) {}

void LastArrival::set(const ::ros::Time& time) {
  time_ = time;
  steady_time_ = ::ros::SteadyTime::now();
}

::ros::Time LastArrival::now() const {
  if (clock_.getNumPublishers() > 0) return ::ros::Time::now();
  return shifted(time_, (::ros::SteadyTime::now() - steady_time_).toSec());
}

}  // namespace usct::ros_interface
