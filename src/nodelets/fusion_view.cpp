#include "ros/fusion/fusion_view.h"

#include <pluginlib/class_list_macros.hpp>

#include "ros/node/nodelet_of.h"

namespace usct::ros_interface {

class FusionViewNodelet : public NodeletOf<FusionViewNode> {};

}  // namespace usct::ros_interface

PLUGINLIB_EXPORT_CLASS(usct::ros_interface::FusionViewNodelet, nodelet::Nodelet)
