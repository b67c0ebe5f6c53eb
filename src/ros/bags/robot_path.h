#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <vector>

/// How a robot moves an ultrasound probe before, during and after sweeps.
namespace usct::ros_interface {

/// How long before the first sweep a robot's path begins, s.
constexpr double kArrivalS = 2.5;

struct StampedPose {
  ::ros::Time stamp;
  Eigen::Isometry3d T;
};

/// The same pose from `first` to `last`, sampled as a robot's driver would.
std::vector<StampedPose> held(const Eigen::Isometry3d& T, const ::ros::Time& first,
                              const ::ros::Time& last);

/// The poses of the sweeps and, around each sweep, the robot's arrival and departure: before and
/// after a sweep the probe stands still for a moment, and it moves away by `retract_mm` along its
/// axis. `pause_s` is the time from sweep to sweep, and that after the last.
std::vector<StampedPose> robot_path(const std::vector<std::vector<StampedPose>>& sweeps,
                                    double pause_s, double retract_mm);

}  // namespace usct::ros_interface
