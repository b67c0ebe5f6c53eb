#include "ros/ct/ct_server.h"

#include <pluginlib/class_list_macros.hpp>

#include "ros/node/nodelet_of.h"

namespace usct::ros_interface {
class CtServerNodelet : public NodeletOf<CtServer> {};
}  // namespace usct::ros_interface

PLUGINLIB_EXPORT_CLASS(usct::ros_interface::CtServerNodelet, nodelet::Nodelet)
