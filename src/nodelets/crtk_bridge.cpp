#include "ros/crtk/crtk_bridge.h"

#include <pluginlib/class_list_macros.hpp>

#include "ros/node/nodelet_of.h"

namespace usct::ros_interface {

class CrtkBridgeNodelet : public NodeletOf<CrtkBridge> {};

}  // namespace usct::ros_interface

PLUGINLIB_EXPORT_CLASS(usct::ros_interface::CrtkBridgeNodelet, nodelet::Nodelet)
