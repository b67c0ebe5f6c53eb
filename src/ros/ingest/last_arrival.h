#pragma once

#include <ros/node_handle.h>

namespace usct::ros_interface {

/// The arrival of the last frame, and the time by which a pause since then is measured.
///
/// ROS time counts as long as somebody publishes `/clock`: a recording that is paused, or played
/// slowly, makes no pause of the frames. Otherwise the machine's time counts. In real time both are
/// the same; simulated time stands still for good once the recording has ended, and a pause would
/// never be noticed.
class LastArrival {
 public:
  explicit LastArrival(::ros::NodeHandle node);

  /// A frame has arrived at `time`, which is the present ROS time.
  void set(const ::ros::Time& time);
  /// The ROS time of the arrival; 0 if there was none.
  const ::ros::Time& time() const { return time_; }
  /// The present time.
  ::ros::Time now() const;

 private:
  ::ros::Subscriber clock_;
  ::ros::Time time_;
  ::ros::SteadyTime steady_time_;
};

}  // namespace usct::ros_interface
