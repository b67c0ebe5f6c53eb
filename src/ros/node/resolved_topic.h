#pragma once

#include <ros/node_handle.h>

#include <string>

namespace usct::ros_interface {

/// A node handle that takes `topic`, a name which is resolved already, as it is. image_transport
/// must be given such names, since the suffix of a transport is appended before ROS remaps and then
/// hides the name; but ROS would remap them once more, and turn two swapped topics back.
::ros::NodeHandle node_for_resolved(const ::ros::NodeHandle& node, const std::string& topic);

}  // namespace usct::ros_interface
