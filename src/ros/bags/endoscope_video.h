#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/time.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <string>
#include <vector>

#include "ros/bags/recording.h"
#include "us_ct_registration/geometry/camera.h"

/// The video of a stereo endoscope that a robot holds, in a bag.
namespace usct::ros_interface {

/// A rendered video whose true poses are known (`usct phantom --endoscope`).
struct EndoscopeVideo {
  /// The folder of the images: `left_0000.png`, `right_0000.png`, and of the masks of the tumour,
  /// `left_tumour_0000.png`, ...
  std::filesystem::path folder;
  CameraIntrinsics camera;
  /// The right camera is this far along the x axis of the left one.
  double baseline_mm = 0.0;
  struct Frame {
    double time_s;
    Eigen::Isometry3d T_ct_left;
  };
  std::vector<Frame> frames;
};

/// The frames of tf between the fixed frame and the cameras. The robot's kinematics give
/// base -> tip; hand-eye calibration gives tip -> left; the calibration of the pair left -> right.
struct EndoscopeFrames {
  std::string base = "robot_base";
  std::string tip = "endoscope_tip";
  std::string left = "endoscope_left_optical";
  std::string right = "endoscope_right_optical";
};

/// The calibrations, which do not change: fixed frame -> base, tip -> left, left -> right.
std::vector<geometry_msgs::TransformStamped> endoscope_calibration(const EndoscopeVideo& video,
                                                                   const std::string& fixed_frame,
                                                                   const EndoscopeFrames& frames,
                                                                   const ::ros::Time& stamp);

/// Records images, camera_info, masks (`/truth/endoscope/left/tumour`) and tf base -> tip at the
/// stamps `first + time_s`. Throws InputError, naming the file, if an image is missing or has not
/// the camera's size.
void record_endoscope(const EndoscopeVideo& video, const Eigen::Isometry3d& T_fixed_ct,
                      const EndoscopeFrames& frames, const ::ros::Time& first,
                      Recording& recording);

}  // namespace usct::ros_interface
