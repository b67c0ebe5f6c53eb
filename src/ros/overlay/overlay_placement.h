#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <string>

#include "ros/overlay/overlay_scene.h"
#include "ros/tf/tf_buffer.h"

namespace usct::ros_interface {

/// The pose of the CT in a frame, such as a camera's at the stamp of its image, mm, from tf. Waits
/// at most `timeout_s` of wall time for tf to reach the stamp.
///
/// Throws Refusal if the stamp is 0 (which tf would take for the newest transform) or far ahead of
/// `now`, if tf does not connect the frames at the stamp, or if tf has another pose of the CT there
/// than the alignment of the scene: look-ups still show the one before, or another publisher is at
/// work.
Eigen::Isometry3d T_frame_ct_at(const TfBuffer& tf, const OverlayScene& scene,
                                const std::string& frame, const ::ros::Time& stamp,
                                const ::ros::Time& now, double timeout_s);

}  // namespace usct::ros_interface
