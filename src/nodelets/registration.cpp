#include <pluginlib/class_list_macros.hpp>

#include "ros/node/nodelet_of.h"
#include "ros/registration/registration_node.h"

namespace usct::ros_interface {
class RegistrationNodelet : public NodeletOf<RegistrationNode> {};
}  // namespace usct::ros_interface

PLUGINLIB_EXPORT_CLASS(usct::ros_interface::RegistrationNodelet, nodelet::Nodelet)
