#include "ros/fusion/us_cloud.h"

#include <pluginlib/class_list_macros.hpp>

#include "ros/node/nodelet_of.h"

namespace usct::ros_interface {

class UsCloudNodelet : public NodeletOf<UsCloud> {};

}  // namespace usct::ros_interface

PLUGINLIB_EXPORT_CLASS(usct::ros_interface::UsCloudNodelet, nodelet::Nodelet)
