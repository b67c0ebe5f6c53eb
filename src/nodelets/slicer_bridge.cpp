#include "ros/slicer/slicer_bridge.h"

#include <pluginlib/class_list_macros.hpp>

#include "ros/node/nodelet_of.h"

namespace usct::ros_interface {
class SlicerBridgeNodelet : public NodeletOf<SlicerBridge> {};
}  // namespace usct::ros_interface

PLUGINLIB_EXPORT_CLASS(usct::ros_interface::SlicerBridgeNodelet, nodelet::Nodelet)
