#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>
#include <string>

namespace usct {

/// Focal lengths, principal point and lens distortion of a camera, in pixels of its image. Pixel
/// (x, y) has its centre at (x, y), x to the right and y down, as in OpenCV.
struct CameraIntrinsics {
  int width = 0;
  int height = 0;
  double fx = 0.0;
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
  /// k1, k2, p1, p2, k3, k4, k5, k6 of OpenCV. The rational model uses all eight, plumb_bob the
  /// first five; all zero: no distortion.
  std::array<double, 8> distortion{};
};

/// A camera that projects points of its optical frame (z forward, x right, y down; any unit of
/// length) to pixels.
///
/// The polynomials of a distortion model hold within the image. Far outside they fold back, and
/// would draw into the image what lies beside it. Beyond the corners of the image the radial
/// distortion is therefore continued along its tangent.
class Camera {
 public:
  /// Throws InputError, naming `source`, if the size or a focal length is not > 0, a number is not
  /// finite, or the distortion folds back within the image.
  Camera(const CameraIntrinsics& intrinsics, const std::string& source);

  const CameraIntrinsics& intrinsics() const { return intrinsics_; }
  bool is_distorted() const { return is_distorted_; }

  /// The pixel of a point with z > 0.
  Eigen::Vector2d project(const Eigen::Vector3d& p) const;
  /// The same in single precision, for many points: `normalised` is x / z, y / z.
  Eigen::Vector2f project_normalised(const Eigen::Vector2f& normalised) const;

  /// The point at z = 1 that is projected to a pixel. The pixel should be in the image or near it.
  Eigen::Vector3d ray(const Eigen::Vector2d& pixel) const;

  /// The farthest that the pixel of a point with z > 0 moves if the point moves by one unit of
  /// length: the largest singular value of the derivative of `project`.
  double pixels_per_length(const Eigen::Vector3d& p) const;

 private:
  template <typename T>
  Eigen::Matrix<T, 2, 1> distorted(const Eigen::Matrix<T, 2, 1>& normalised) const;
  void find_limit(const std::string& source);

  CameraIntrinsics intrinsics_;
  bool is_distorted_ = false;
  /// Up to this distance from the axis at z = 1 the polynomials are used.
  double limit_ = std::numeric_limits<double>::infinity();
  double slope_at_limit_ = 1.0;
};

}  // namespace usct
