#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <vector>

/// The path of an ultrasound probe that a robot moves, before, during and after sweeps.
namespace usct::ros_interface {

/// Time between the beginning of a robot's path and the first sweep, s.
constexpr double kArrivalS = 2.5;

struct StampedPose {
  ::ros::Time stamp;
  Eigen::Isometry3d T;
};

/// A constant pose from `first` to `last`, sampled as by a robot's driver.
std::vector<StampedPose> held(const Eigen::Isometry3d& T, const ::ros::Time& first,
                              const ::ros::Time& last);

/// The poses of the sweeps and, around each sweep, the robot's arrival and departure: before and
/// after a sweep the probe stands still for a moment, and it moves away by `retract_mm` along its
/// axis. `pause_s` is the time between sweeps, and after the last one.
std::vector<StampedPose> robot_path(const std::vector<std::vector<StampedPose>>& sweeps,
                                    double pause_s, double retract_mm);

}  // namespace usct::ros_interface
