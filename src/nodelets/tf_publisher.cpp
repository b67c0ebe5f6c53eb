#include "ros/alignment/tf_publisher.h"

#include <pluginlib/class_list_macros.hpp>

#include "ros/node/nodelet_of.h"

namespace usct::ros_interface {
class TfPublisherNodelet : public NodeletOf<TfPublisher> {};
}  // namespace usct::ros_interface

PLUGINLIB_EXPORT_CLASS(usct::ros_interface::TfPublisherNodelet, nodelet::Nodelet)
