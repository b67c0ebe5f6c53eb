#include "us_ct_registration/geometry/camera.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "require.h"

namespace usct {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

template <typename T>
T radial_factor(const std::array<double, 8>& d, T square) {
  const auto k = [&d](int i) { return static_cast<T>(d[static_cast<std::size_t>(i)]); };
  const T above = 1 + square * (k(0) + square * (k(1) + square * k(4)));
  const T below = 1 + square * (k(5) + square * (k(6) + square * k(7)));
  return above / below;
}

/// Derivative of the distorted distance from the axis by the undistorted one.
double radial_slope(const std::array<double, 8>& d, double radius) {
  constexpr double kStep = 1e-5;
  const auto distance = [&d](double r) { return r * radial_factor(d, r * r); };
  return (distance(radius + kStep) - distance(radius - kStep)) / (2.0 * kStep);
}

/// OpenCV's model, Brown's tangential terms included.
template <typename T>
Eigen::Matrix<T, 2, 1> polynomial(const std::array<double, 8>& d, T x, T y) {
  const T p1 = static_cast<T>(d[2]);
  const T p2 = static_cast<T>(d[3]);
  const T square = x * x + y * y;
  const T radial = radial_factor(d, square);
  return {x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x),
          y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y};
}

}  // namespace

Camera::Camera(const CameraIntrinsics& intrinsics, const std::string& source)
    : intrinsics_(intrinsics) {
  require(intrinsics.width > 0, source, "width", intrinsics.width, "> 0");
  require(intrinsics.height > 0, source, "height", intrinsics.height, "> 0");
  require_positive(source, "fx", intrinsics.fx);
  require_positive(source, "fy", intrinsics.fy);
  require(std::isfinite(intrinsics.cx), source, "cx", intrinsics.cx, "finite");
  require(std::isfinite(intrinsics.cy), source, "cy", intrinsics.cy, "finite");
  for (const double value : intrinsics.distortion)
    require(std::isfinite(value), source, "D", value, "finite");
  is_distorted_ = std::any_of(intrinsics.distortion.begin(), intrinsics.distortion.end(),
                              [](double value) { return value != 0.0; });
  if (is_distorted_) find_limit(source);
}

void Camera::find_limit(const std::string& source) {
  constexpr double kBeyondCorners = 1.1;
  constexpr double kStep = 0.002;
  constexpr double kLeastSlope = 0.05;
  constexpr double kMostRadius = 10.0;  // 84 degrees from the axis
  std::array<Vector2d, 4> corners;
  double corner = 0.0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    corners[i] = {i % 2 == 0 ? -0.5 : intrinsics_.width - 0.5,
                  i / 2 == 0 ? -0.5 : intrinsics_.height - 0.5};
    corner = std::max(corner, std::hypot((corners[i].x() - intrinsics_.cx) / intrinsics_.fx,
                                         (corners[i].y() - intrinsics_.cy) / intrinsics_.fy));
  }
  const std::array<double, 8>& d = intrinsics_.distortion;
  double radius = 0.0;
  double distance = 0.0;
  while (distance < kBeyondCorners * corner && radius < kMostRadius &&
         radial_slope(d, radius + kStep) > kLeastSlope) {
    radius += kStep;
    distance = radius * radial_factor(d, radius * radius);
  }
  const auto require_rising = [&](bool rises) {
    require(rises, source, "D", distance,
            "distortion that rises up to the corners of the image, at a distance of " +
                std::to_string(corner) + " focal lengths from its centre; it folds back here");
  };
  require_rising(distance >= corner);
  limit_ = radius;
  slope_at_limit_ = radial_slope(d, radius);
  // The tangential terms may take a corner beyond.
  for (const Vector2d& pixel : corners) require_rising(ray(pixel).head<2>().norm() <= limit_);
}

template <typename T>
Eigen::Matrix<T, 2, 1> Camera::distorted(const Eigen::Matrix<T, 2, 1>& normalised) const {
  if (!is_distorted_) return normalised;
  const T radius = normalised.norm();
  const auto limit = static_cast<T>(limit_);
  if (radius <= limit) return polynomial<T>(intrinsics_.distortion, normalised.x(), normalised.y());
  const Eigen::Matrix<T, 2, 1> direction = normalised / radius;
  const Eigen::Matrix<T, 2, 1> edge = limit * direction;
  return polynomial<T>(intrinsics_.distortion, edge.x(), edge.y()) +
         static_cast<T>(slope_at_limit_) * (radius - limit) * direction;
}

Vector2d Camera::project(const Vector3d& p) const {
  const Vector2d at = distorted<double>(Vector2d(p.x() / p.z(), p.y() / p.z()));
  return {intrinsics_.fx * at.x() + intrinsics_.cx, intrinsics_.fy * at.y() + intrinsics_.cy};
}

Eigen::Vector2f Camera::project_normalised(const Eigen::Vector2f& normalised) const {
  const Eigen::Vector2f at = distorted<float>(normalised);
  return {static_cast<float>(intrinsics_.fx) * at.x() + static_cast<float>(intrinsics_.cx),
          static_cast<float>(intrinsics_.fy) * at.y() + static_cast<float>(intrinsics_.cy)};
}

Vector3d Camera::ray(const Vector2d& pixel) const {
  const Vector2d wanted((pixel.x() - intrinsics_.cx) / intrinsics_.fx,
                        (pixel.y() - intrinsics_.cy) / intrinsics_.fy);
  Vector2d at = wanted;
  if (is_distorted_) {
    // Newton's method, from the undistorted position; near the corners it needs some ten steps. A
    // step that leads farther away is shortened.
    constexpr int kMostSteps = 30;
    constexpr double kStep = 1e-6;
    constexpr double kClose = 1e-12;
    constexpr double kLeastShare = 1e-3;
    Vector2d error = distorted<double>(at) - wanted;
    for (int step = 0; step < kMostSteps && error.squaredNorm() >= kClose * kClose; ++step) {
      Eigen::Matrix2d slope;
      for (int axis = 0; axis < 2; ++axis) {
        const Vector2d by = kStep * Vector2d::Unit(axis);
        slope.col(axis) = (distorted<double>(at + by) - distorted<double>(at - by)) / (2.0 * kStep);
      }
      const Vector2d whole = slope.inverse() * error;
      const double before = error.squaredNorm();
      double share = 1.0;
      error = distorted<double>(at - whole) - wanted;
      while (error.squaredNorm() > before && share > kLeastShare) {
        share *= 0.5;
        error = distorted<double>(at - share * whole) - wanted;
      }
      at -= share * whole;
    }
  }
  return {at.x(), at.y(), 1.0};
}

double Camera::pixels_per_length(const Vector3d& p) const {
  const double step = 1e-4 * p.z();
  Eigen::Matrix<double, 2, 3> derivative;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d by = step * Vector3d::Unit(axis);
    derivative.col(axis) = (project(p + by) - project(p - by)) / (2.0 * step);
  }
  // The larger eigenvalue of the symmetric 2 x 2 matrix J J^T.
  const Eigen::Matrix2d square = derivative * derivative.transpose();
  const double mean = 0.5 * square.trace();
  const double half = std::hypot(0.5 * (square(0, 0) - square(1, 1)), square(0, 1));
  return std::sqrt(mean + half);
}

}  // namespace usct
