#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <us_ct_registration/OverlayStatus.h>

#include <optional>
#include <string>

#include "ros/overlay/camera_model.h"
#include "ros/overlay/overlay_scene.h"
#include "ros/tf/tf_buffer.h"
#include "us_ct_registration/rendering/overlay.h"

namespace usct::ros_interface {

struct OverlayPainterOptions {
  OverlayOptions drawing;
  /// Longest wait for tf to reach the stamp of an image, s.
  double tf_timeout_s = 0.1;
  /// Bounds, of the same probability as that of the registration, of the error that the calibration
  /// of the camera adds to each pixel, and of the position and the direction in which hand-eye
  /// calibration and kinematics place the camera.
  double camera_error_px = 0.0;
  double hand_eye_error_mm = 0.0;
  double hand_eye_error_rad = 0.0;
};

/// An image that has arrived, and what belongs to it.
struct OverlayJob {
  sensor_msgs::ImageConstPtr image;
  sensor_msgs::CameraInfoConstPtr info;  // null: `problem` says why there is none
  CameraUse use;
  std::string problem;
  /// A fault of the images themselves, in words; empty if there is none.
  std::string warning;
  ::ros::WallTime received;
};

/// The image with what was drawn into it.
struct Overlay {
  sensor_msgs::ImagePtr image;  // null: the image cannot be decoded, as the status says
  us_ct_registration::OverlayStatus status;
};

/// Draws the scene into the images of one camera, and in words into each image what a person who
/// looks at it must know. One object per thread.
class OverlayPainter {
 public:
  /// `keeper` and `tf` must outlive the painter.
  OverlayPainter(OverlayPainterOptions options, const OverlaySceneKeeper& keeper,
                 const TfBuffer& tf);

  Overlay paint(const OverlayJob& job);

 private:
  /// Draws the scene into the image, and fills the status. Throws an exception that says why it
  /// cannot.
  void draw(const OverlayJob& job, const OverlayScene& scene, const ImageView& image,
            us_ct_registration::OverlayStatus& status);
  /// Adds to the bound of the registration those of camera and hand-eye calibration.
  void widen_bounds(const Eigen::Isometry3d& T_camera_ct,
                    std::vector<OverlayStructure>& structures) const;

  const OverlayPainterOptions options_;
  const OverlaySceneKeeper& keeper_;
  const TfBuffer& tf_;
  OverlayRenderer renderer_;
};

}  // namespace usct::ros_interface
