#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <tf2_ros/transform_broadcaster.h>
#include <topic_tools/shape_shifter.h>

#include <memory>
#include <vector>

#include "ros/crtk/arm_bridge.h"
#include "ros/crtk/crtk_parameters.h"
#include "ros/crtk/target_publisher.h"

namespace usct::ros_interface {

/// The node `crtk_bridge` connects a robot that speaks CRTK, such as the dVRK: the arms'
/// `measured_js` become `ARM/joint_states` for robot_state_publisher, or their `measured_cp` become
/// tf, and points of the CT are published as poses in the robot's frame. It wires topics and
/// parameters to one ArmBridge for each arm and to TargetPublisher. docs/nodes/crtk_bridge.md.
class CrtkBridge {
 public:
  CrtkBridge(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);

 private:
  void add_arm(const ArmBridgeOptions& options, const std::string& robot_description);
  void take_pose(ArmBridge& arm, const topic_tools::ShapeShifter& message);
  void take_joints(ArmBridge& arm, const ::ros::Publisher& publisher,
                   const sensor_msgs::JointState& message);
  void diagnose_arm(const ArmBridge& arm, diagnostic_updater::DiagnosticStatusWrapper& diagnosis);
  void diagnose_targets(diagnostic_updater::DiagnosticStatusWrapper& diagnosis);

  ::ros::NodeHandle node_;
  tf2_ros::TransformBroadcaster broadcaster_;
  std::vector<std::unique_ptr<ArmBridge>> arms_;
  std::unique_ptr<TargetPublisher> targets_;
  std::vector<::ros::Subscriber> subscribers_;
  diagnostic_updater::Updater diagnostics_;
  ::ros::WallTimer diagnostics_timer_;
};

}  // namespace usct::ros_interface
