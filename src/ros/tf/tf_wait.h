#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/time.h>

#include <string>

#include "ros/tf/tf_buffer.h"

namespace usct::ros_interface {

/// The transform from `source` to `target` at a stamp. Waits at most `timeout_s` of wall time for
/// tf to reach it: simulated time may stand still, and the time of tf2_ros::Buffer with it.
///
/// Throws Refusal with frames and stamp: TF_UNAVAILABLE if tf does not connect them then, and at
/// once INVALID_MESSAGE if a name has a leading slash.
geometry_msgs::TransformStamped wait_for_transform(const TfBuffer& tf, const std::string& target,
                                                   const std::string& source,
                                                   const ::ros::Time& stamp, double timeout_s);

}  // namespace usct::ros_interface
