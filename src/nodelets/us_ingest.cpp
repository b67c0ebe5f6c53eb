#include "ros/ingest/us_ingest.h"

#include <pluginlib/class_list_macros.hpp>

#include "ros/node/nodelet_of.h"

namespace usct::ros_interface {
class UsIngestNodelet : public NodeletOf<UsIngest> {};
}  // namespace usct::ros_interface

PLUGINLIB_EXPORT_CLASS(usct::ros_interface::UsIngestNodelet, nodelet::Nodelet)
