#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/time.h>
#include <tf2/buffer_core.h>

#include <string>

namespace usct::ros_interface {

/// For so long the nodes remember poses, s: as long as a slow sweep takes, of which each frame is
/// looked up when the sweep has ended.
constexpr double kTfHistory_s = 60.0;

/// The transform from `source` to `target` at a stamp. Waits at most `timeout_s` of wall time for
/// tf to reach it: simulated time may stand still, and the time of tf2_ros::Buffer with it.
///
/// Throws Refusal with frames and stamp: TF_UNAVAILABLE if tf does not connect them then, and at
/// once INVALID_MESSAGE if a name has a leading slash.
geometry_msgs::TransformStamped wait_for_transform(const tf2::BufferCore& tf,
                                                   const std::string& target,
                                                   const std::string& source,
                                                   const ::ros::Time& stamp, double timeout_s);

}  // namespace usct::ros_interface
