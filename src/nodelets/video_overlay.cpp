#include "ros/overlay/video_overlay.h"

#include <pluginlib/class_list_macros.hpp>

#include "ros/node/nodelet_of.h"

namespace usct::ros_interface {

class VideoOverlayNodelet : public NodeletOf<VideoOverlay> {};

}  // namespace usct::ros_interface

PLUGINLIB_EXPORT_CLASS(usct::ros_interface::VideoOverlayNodelet, nodelet::Nodelet)
