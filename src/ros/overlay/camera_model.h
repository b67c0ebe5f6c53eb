#pragma once

#include <sensor_msgs/CameraInfo.h>

#include <Eigen/Geometry>
#include <optional>
#include <string>

#include "us_ct_registration/geometry/camera.h"

namespace usct::ros_interface {

/// The projection of points, from the frame that a CameraInfo names to pixels of the image.
struct CameraModel {
  Camera camera;
  /// From the frame of the CameraInfo to that in which `camera` projects, mm.
  Eigen::Isometry3d T_camera_frame;
};

/// Facts about a camera that its CameraInfo does not state.
struct CameraUse {
  /// The images are rectified: they follow P and R; raw images follow K and D.
  bool is_rectified = false;
  /// R of the left camera, if this is the right one of a stereo pair and its frame is that of the
  /// left: points then lie in the left camera's frame, and P must contain the baseline.
  std::optional<Eigen::Matrix3d> R_of_left;
};

/// Rotation R of a CameraInfo; the identity if all its numbers are zero.
Eigen::Matrix3d rectification_of(const sensor_msgs::CameraInfo& info);

/// Throws InputError, naming `source`: if the camera is not calibrated, if the distortion model of
/// raw images is neither plumb_bob nor rational_polynomial or has the wrong number of coefficients,
/// if R is no rotation, if a right camera in the left one's frame has no baseline, and as `Camera`.
/// Binning and region of interest are taken into account; the region is that of the raw image for
/// rectified images as well, as image_geometry and image_proc have it.
CameraModel camera_model(const sensor_msgs::CameraInfo& info, const CameraUse& use,
                         const std::string& source);

}  // namespace usct::ros_interface
