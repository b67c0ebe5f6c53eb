#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <vector>

#include "ros/overlay/overlay_scene.h"

namespace usct::ros_interface {

/// Subscribes `keeper`, which must outlive the subscribers, to the CT's surfaces and to what is
/// decided about the alignment. A message that it cannot use is an error in the log.
std::vector<::ros::Subscriber> subscribe_to_scene(::ros::NodeHandle node,
                                                  OverlaySceneKeeper& keeper);

}  // namespace usct::ros_interface
