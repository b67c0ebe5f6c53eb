#include "ros/overlay/camera_model.h"

#include <image_geometry/pinhole_camera_model.h>
#include <sensor_msgs/distortion_models.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "ros/conversions/poses.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

bool is_any_not_zero(const std::vector<double>& values) {
  return std::any_of(values.begin(), values.end(), [](double value) { return value != 0.0; });
}

void require_known_distortion(const sensor_msgs::CameraInfo& info, const std::string& source) {
  namespace models = sensor_msgs::distortion_models;
  const std::string& model = info.distortion_model;
  const std::size_t count = info.D.size();
  if (model.empty() && !is_any_not_zero(info.D)) return;
  if (model != models::PLUMB_BOB && model != models::RATIONAL_POLYNOMIAL)
    throw InputError(source, "'distortion_model' is '" + model + "', must be " + models::PLUMB_BOB +
                                 " or " + models::RATIONAL_POLYNOMIAL);
  const std::size_t wanted = model == models::PLUMB_BOB ? 5 : 8;
  if (count != wanted && count != 0)
    throw InputError(source, "'D' has " + std::to_string(count) + " numbers, must have " +
                                 std::to_string(wanted) + " for " + model);
}

CameraIntrinsics intrinsics_of(const image_geometry::PinholeCameraModel& model,
                               const sensor_msgs::CameraInfo& info, bool is_rectified) {
  CameraIntrinsics intrinsics;
  const cv::Rect region = model.rawRoi();
  intrinsics.width = region.width / static_cast<int>(model.binningX());
  intrinsics.height = region.height / static_cast<int>(model.binningY());
  if (is_rectified) {
    const cv::Matx34d& P = model.projectionMatrix();
    intrinsics.fx = P(0, 0);
    intrinsics.fy = P(1, 1);
    intrinsics.cx = P(0, 2);
    intrinsics.cy = P(1, 2);
    return intrinsics;
  }
  const cv::Matx33d& K = model.intrinsicMatrix();
  intrinsics.fx = K(0, 0);
  intrinsics.fy = K(1, 1);
  intrinsics.cx = K(0, 2);
  intrinsics.cy = K(1, 2);
  // Without a model there may be any number of zeros.
  if (is_any_not_zero(info.D))
    std::copy(info.D.begin(), info.D.end(), intrinsics.distortion.begin());
  return intrinsics;
}

/// image_geometry computes with them as integers of 32 bits with a sign.
void require_possible_sizes(const sensor_msgs::CameraInfo& info, const std::string& source) {
  constexpr std::uint32_t kMost = 65535;
  const auto& roi = info.roi;
  for (const auto& [name, value] :
       {std::pair("width", info.width), std::pair("height", info.height),
        std::pair("binning_x", info.binning_x), std::pair("binning_y", info.binning_y),
        std::pair("roi.x_offset", roi.x_offset), std::pair("roi.y_offset", roi.y_offset),
        std::pair("roi.width", roi.width), std::pair("roi.height", roi.height)})
    if (value > kMost)
      throw InputError(source, std::string("'") + name + "' is " + std::to_string(value) +
                                   ", must be <= " + std::to_string(kMost));
}

void require_rotation(const Eigen::Matrix3d& R, const char* name, const std::string& source) {
  constexpr double kRotation = 1e-3;
  if (!R.isUnitary(kRotation) || R.determinant() < 0.0)
    throw InputError(source, std::string(name) + " is not a rotation");
}

/// P of a right camera contains -fx times the baseline.
double baseline_mm(const sensor_msgs::CameraInfo& info, const std::string& source) {
  const double baseline = -kMmPerM * info.P[3] / info.P[0];
  if (!std::isfinite(baseline) || baseline == 0.0)
    throw InputError(source,
                     "its frame '" + info.header.frame_id +
                         "' is that of the left camera, but 'P' has no baseline; calibrate the "
                         "pair, or give the right camera a frame of its own");
  return baseline;
}

}  // namespace

Eigen::Matrix3d rectification_of(const sensor_msgs::CameraInfo& info) {
  const Eigen::Matrix3d R = Eigen::Map<const RowMajor3>(info.R.data());
  return R.isZero(0.0) ? Eigen::Matrix3d::Identity() : R;
}

CameraModel camera_model(const sensor_msgs::CameraInfo& info, const CameraUse& use,
                         const std::string& source) {
  if (!(info.K[0] > 0.0 && info.K[4] > 0.0) || (use.is_rectified && !(info.P[0] > 0.0)))
    throw InputError(source, "the camera is not calibrated: K, or P of rectified images, is zero");
  require_possible_sizes(info, source);
  if (!use.is_rectified) require_known_distortion(info, source);
  const Eigen::Matrix3d R = rectification_of(info);
  require_rotation(R, "'R'", source);
  image_geometry::PinholeCameraModel model;
  try {
    model.fromCameraInfo(info);
  } catch (const std::exception& error) {
    throw InputError(source, error.what());
  }
  Eigen::Isometry3d T_rectified_frame = Eigen::Isometry3d::Identity();
  T_rectified_frame.linear() = use.R_of_left.value_or(R);
  if (use.R_of_left) {
    require_rotation(*use.R_of_left, "'R' of the left camera", source);
    T_rectified_frame.pretranslate(Eigen::Vector3d(-baseline_mm(info, source), 0.0, 0.0));
  }
  Eigen::Isometry3d T_camera_rectified = Eigen::Isometry3d::Identity();
  if (!use.is_rectified) T_camera_rectified.linear() = R.transpose();
  return {Camera(intrinsics_of(model, info, use.is_rectified), source),
          T_camera_rectified * T_rectified_frame};
}

}  // namespace usct::ros_interface
