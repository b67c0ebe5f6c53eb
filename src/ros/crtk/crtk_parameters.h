#pragma once

#include <ros/node_handle.h>

#include <string>
#include <vector>

#include "ros/crtk/arm_bridge.h"
#include "ros/crtk/target_publisher.h"

namespace usct::ros_interface {

/// The parameters of the node `crtk_bridge`; docs/nodes/crtk_bridge.md.
struct CrtkParameters {
  std::vector<ArmBridgeOptions> arms;
  /// Text of the robot's model (URDF); empty if no arm has joints.
  std::string robot_description;
  TargetOptions targets;
  double diagnostic_period_s = 1.0;
};

/// Throws InputError that names the parameter, its value and the constraint.
CrtkParameters read_crtk_parameters(const ::ros::NodeHandle& node,
                                    const ::ros::NodeHandle& private_node);

}  // namespace usct::ros_interface
