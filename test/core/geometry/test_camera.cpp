#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <optional>
#include <random>

#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/camera.h"

namespace usct {
namespace {

CameraIntrinsics endoscope() {
  CameraIntrinsics intrinsics;
  intrinsics.width = 1920;
  intrinsics.height = 1080;
  intrinsics.fx = 1500.0;
  intrinsics.fy = 1490.0;
  intrinsics.cx = 950.5;
  intrinsics.cy = 530.25;
  return intrinsics;
}

/// OpenCV's projection of a point.
Eigen::Vector2d by_opencv(const CameraIntrinsics& c, const Eigen::Vector3d& p) {
  const cv::Matx33d K(c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1);
  const std::vector<double> D(c.distortion.begin(), c.distortion.end());
  std::vector<cv::Point2d> pixels;
  cv::projectPoints(std::vector<cv::Point3d>{{p.x(), p.y(), p.z()}}, cv::Vec3d(), cv::Vec3d(), K, D,
                    pixels);
  return {pixels[0].x, pixels[0].y};
}

/// A camera with random distortion, rational or plumb_bob; none if it folds back in the image.
std::optional<Camera> random_camera(std::mt19937& random, bool is_rational) {
  const auto within = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  CameraIntrinsics c = endoscope();
  c.fx = within(600.0, 2500.0);
  c.fy = c.fx * within(0.95, 1.05);
  c.cx += within(-50.0, 50.0);
  c.cy += within(-50.0, 50.0);
  c.distortion = {within(-0.5, 0.5),
                  within(-0.3, 0.3),
                  within(-0.005, 0.005),
                  within(-0.005, 0.005),
                  within(-0.1, 0.1),
                  0.0,
                  0.0,
                  0.0};
  if (is_rational)
    for (std::size_t i = 5; i < 8; ++i) c.distortion[i] = within(-0.1, 0.1);
  try {
    return Camera(c, "random");
  } catch (const InputError&) {
    return std::nullopt;
  }
}

RC_GTEST_PROP(Camera, ProjectsAsOpenCv, (unsigned seed, bool is_rational)) {
  std::mt19937 random(seed);
  const std::optional<Camera> camera = random_camera(random, is_rational);
  RC_PRE(camera.has_value());
  const CameraIntrinsics& c = camera->intrinsics();
  std::uniform_real_distribution<double> column(0.0, c.width - 1.0);
  std::uniform_real_distribution<double> row(0.0, c.height - 1.0);
  std::uniform_real_distribution<double> depth(5.0, 400.0);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector2d pixel(column(random), row(random));
    const Eigen::Vector3d p = depth(random) * camera->ray(pixel);
    const Eigen::Vector2d expected = by_opencv(c, p);
    RC_ASSERT((expected - pixel).norm() < 1e-6);  // `ray` inverts OpenCV's projection
    RC_ASSERT((camera->project(p) - expected).norm() < 1e-6);
    const Eigen::Vector2f normalised = (p.head<2>() / p.z()).cast<float>();
    RC_ASSERT((camera->project_normalised(normalised).cast<double>() - expected).norm() < 0.01);
  }
}

TEST(Camera, WithoutDistortionIsAPinhole) {
  const Camera camera(endoscope(), "test");
  EXPECT_FALSE(camera.is_distorted());
  const Eigen::Vector2d pixel = camera.project({20.0, -10.0, 100.0});
  EXPECT_NEAR(pixel.x(), 950.5 + 1500.0 * 0.2, 1e-9);
  EXPECT_NEAR(pixel.y(), 530.25 - 1490.0 * 0.1, 1e-9);
}

/// Whole steps of Newton's method overshoot here.
TEST(Camera, CornersOfAStrongLensHaveTheirRays) {
  CameraIntrinsics c = endoscope();
  c.fx = 678.2;
  c.fy = 689.6;
  c.cx = 904.1;
  c.cy = 514.3;
  c.distortion = {0.41382, 0.0679, -0.00101, 0.0028, -0.05939, 0.05342, 0.00165, 0.02915};
  const Camera camera(c, "test");
  for (const double x : {0.0, c.width - 1.0})
    for (const double y : {0.0, c.height - 1.0}) {
      const Eigen::Vector3d p = 80.0 * camera.ray({x, y});
      EXPECT_LT((by_opencv(c, p) - Eigen::Vector2d(x, y)).norm(), 1e-6) << x << ", " << y;
    }
}

/// The polynomial of a barrel distortion turns back: far beside the field it would give pixels of
/// the image.
TEST(Camera, WhatLiesFarBesideTheFieldIsNotProjectedIntoIt) {
  CameraIntrinsics c = endoscope();
  c.distortion[0] = -0.25;
  const Camera camera(c, "test");
  const auto is_in_image = [&](const Eigen::Vector2d& pixel) {
    return pixel.x() > -0.5 && pixel.x() < c.width - 0.5 && pixel.y() > -0.5 &&
           pixel.y() < c.height - 0.5;
  };
  int folded = 0;
  for (double x = 0.8; x < 8.0; x += 0.05) {
    const Eigen::Vector3d p(100.0 * x, 3.0, 100.0);
    folded += is_in_image(by_opencv(c, p)) ? 1 : 0;
    EXPECT_FALSE(is_in_image(camera.project(p))) << x;
    EXPECT_GT(camera.project(p).x(), camera.project({100.0 * (x - 0.05), 3.0, 100.0}).x());
  }
  EXPECT_GT(folded, 5);  // the test tests something
}

/// The derivative of the pinhole at (x, y, z) is f/z [I | -u], u = (x, y) / z; its largest singular
/// value is f/z sqrt(1 + u^2).
TEST(Camera, PixelsPerLengthAreThoseOfThePinhole) {
  CameraIntrinsics c = endoscope();
  c.fy = c.fx;
  const Camera camera(c, "test");
  EXPECT_NEAR(camera.pixels_per_length({0.0, 0.0, 80.0}), c.fx / 80.0, 1e-4);
  EXPECT_NEAR(camera.pixels_per_length({40.0, -30.0, 80.0}),
              c.fx / 80.0 * std::sqrt(1.0 + 2500.0 / 6400.0), 1e-4);
}

TEST(Camera, ImpossibleOnesAreRefused) {
  const auto refused = [](auto change) {
    CameraIntrinsics c = endoscope();
    change(c);
    EXPECT_THROW(Camera(c, "test"), InputError);
  };
  refused([](CameraIntrinsics& c) { c.width = 0; });
  refused([](CameraIntrinsics& c) { c.fx = 0.0; });
  refused([](CameraIntrinsics& c) { c.cy = std::numeric_limits<double>::quiet_NaN(); });
  refused([](CameraIntrinsics& c) { c.distortion[1] = std::numeric_limits<double>::infinity(); });
  // r (1 - 2 r^2) turns back at r = 0.41; the corners are at 0.74.
  refused([](CameraIntrinsics& c) { c.distortion[0] = -2.0; });
  // The radial distortion reaches the corners. With the tangential one OpenCV's projection of the
  // whole field comes no nearer than 2 pixels to the upper left one.
  refused([](CameraIntrinsics& c) {
    c.fx = 2136.3;
    c.fy = 2090.28;
    c.cx = 958.82;
    c.cy = 567.63;
    c.distortion = {-0.470371, -0.063551, -0.000551, 0.004466, -0.050662};
  });
}

}  // namespace
}  // namespace usct
