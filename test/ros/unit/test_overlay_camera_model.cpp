#include <gtest/gtest.h>

#include <cmath>

#include "ros/overlay/camera_model.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

sensor_msgs::CameraInfo full_hd() {
  sensor_msgs::CameraInfo info;
  info.width = 1920;
  info.height = 1080;
  info.distortion_model = "plumb_bob";
  info.D = {-0.2, 0.05, 0.001, -0.002, 0.01};
  info.K = {1500, 0, 950, 0, 1490, 530, 0, 0, 1};
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.P = {1400, 0, 940, 0, 0, 1400, 535, 0, 0, 0, 1, 0};
  return info;
}

Eigen::Matrix3d turned() {
  return Eigen::AngleAxisd(0.03, Eigen::Vector3d(1, 2, -1).normalized()).matrix();
}

void set_rectification(sensor_msgs::CameraInfo& info, const Eigen::Matrix3d& R) {
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      info.R[static_cast<std::size_t>(3 * row + column)] = R(row, column);
}

Eigen::Vector2d pixel_of(const CameraModel& model, const Eigen::Vector3d& p_mm) {
  return model.camera.project(model.T_camera_frame * p_mm);
}

/// The pixel by the definition of P in CameraInfo, of a point in the rectified frame (mm).
Eigen::Vector2d by_p(const sensor_msgs::CameraInfo& info, const Eigen::Vector3d& p_mm) {
  const Eigen::Matrix<double, 3, 4> P =
      Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(info.P.data());
  const Eigen::Vector3d uvw = P * (p_mm / 1000.0).homogeneous();
  return uvw.hnormalized();
}

const Eigen::Vector3d kPoint(12.0, -7.0, 90.0);

TEST(CameraModel, RawImagesFollowKAndD) {
  sensor_msgs::CameraInfo info = full_hd();
  set_rectification(info, turned());  // means nothing to raw images
  const CameraModel model = camera_model(info, {}, "test");
  // x = 0.1333, y = -0.0778: Brown's model, written out.
  const double x = 12.0 / 90.0;
  const double y = -7.0 / 90.0;
  const double r2 = x * x + y * y;
  const double radial = 1 - 0.2 * r2 + 0.05 * r2 * r2 + 0.01 * r2 * r2 * r2;
  const double u = x * radial + 2 * 0.001 * x * y - 0.002 * (r2 + 2 * x * x);
  const double v = y * radial + 0.001 * (r2 + 2 * y * y) - 2 * 0.002 * x * y;
  EXPECT_NEAR(pixel_of(model, kPoint).x(), 1500 * u + 950, 1e-6);
  EXPECT_NEAR(pixel_of(model, kPoint).y(), 1490 * v + 530, 1e-6);
}

TEST(CameraModel, RectifiedImagesFollowPAndR) {
  sensor_msgs::CameraInfo info = full_hd();
  set_rectification(info, turned());
  CameraUse use;
  use.is_rectified = true;
  const Eigen::Vector2d expected = by_p(info, turned() * kPoint);
  EXPECT_LT((pixel_of(camera_model(info, use, "test"), kPoint) - expected).norm(), 1e-6);
}

TEST(CameraModel, TheRightCameraInTheFrameOfTheLeftHasTheBaselineOfP) {
  sensor_msgs::CameraInfo right = full_hd();
  right.P[3] = -1400 * 0.0052;
  set_rectification(right, turned());
  const Eigen::Matrix3d R_left = turned().transpose();
  CameraUse use;
  use.is_rectified = true;
  use.R_of_left = R_left;
  const Eigen::Vector3d p_rectified = R_left * kPoint;
  EXPECT_LT((pixel_of(camera_model(right, use, "test"), kPoint) - by_p(right, p_rectified)).norm(),
            1e-6);
  // The disparity to the left image is f b / z.
  EXPECT_NEAR(by_p(full_hd(), p_rectified).x() - by_p(right, p_rectified).x(),
              1400 * 5.2 / p_rectified.z(), 1e-9);
  // Raw: the point is moved in the rectified frame, then turned back into the right camera's.
  use.is_rectified = false;
  const CameraModel raw = camera_model(right, use, "test");
  const Eigen::Vector3d p_right =
      turned().transpose() * (p_rectified - Eigen::Vector3d(5.2, 0.0, 0.0));
  EXPECT_LT((raw.T_camera_frame * kPoint - p_right).norm(), 1e-9);
  // In a frame of its own the camera has no baseline.
  EXPECT_TRUE(
      camera_model(right, {}, "test").T_camera_frame.isApprox(Eigen::Isometry3d::Identity()));
}

/// Two cameras that were calibrated each alone, with one frame: the right eye would be drawn from
/// the left one's place.
TEST(CameraModel, TheRightCameraInTheFrameOfTheLeftMustHaveABaseline) {
  CameraUse use;
  use.R_of_left = Eigen::Matrix3d::Identity();
  const auto reason = [&](auto change) -> std::string {
    sensor_msgs::CameraInfo right = full_hd();
    right.P[3] = -1400 * 0.0052;
    change(right);
    try {
      camera_model(right, use, "camera_info");
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  using Info = sensor_msgs::CameraInfo;
  EXPECT_EQ(reason([](Info&) {}), "accepted");
  EXPECT_NE(reason([](Info& i) { i.P[3] = 0.0; }).find("no baseline"), std::string::npos);
  EXPECT_NE(reason([](Info& i) { i.P.fill(0.0); }).find("no baseline"), std::string::npos);
  EXPECT_NE(reason([](Info& i) { i.P[3] = NAN; }).find("no baseline"), std::string::npos);
  use.R_of_left = 2.0 * Eigen::Matrix3d::Identity();
  EXPECT_NE(reason([](Info&) {}).find("'R' of the left camera"), std::string::npos);
}

/// image_proc cuts rectified images as the raw ones are cut, and image_geometry moves P with them.
TEST(CameraModel, TheRegionOfInterestOfRectifiedImagesIsThatOfTheRaw) {
  sensor_msgs::CameraInfo info = full_hd();
  info.roi.x_offset = 200;
  info.roi.y_offset = 100;
  info.roi.width = 1000;
  info.roi.height = 800;
  info.roi.do_rectify = true;
  CameraUse use;
  use.is_rectified = true;
  const CameraModel model = camera_model(info, use, "test");
  EXPECT_EQ(model.camera.intrinsics().width, 1000);
  EXPECT_EQ(model.camera.intrinsics().height, 800);
  const Eigen::Vector2d whole = by_p(full_hd(), kPoint);
  EXPECT_LT((pixel_of(model, kPoint) - (whole - Eigen::Vector2d(200, 100))).norm(), 1e-6);
}

TEST(CameraModel, TheLensOfRectifiedImagesDoesNotCount) {
  sensor_msgs::CameraInfo info = full_hd();
  info.distortion_model = "equidistant";
  info.D = {0.1, 0.01, 0.0, 0.0};
  CameraUse use;
  use.is_rectified = true;
  EXPECT_LT((pixel_of(camera_model(info, use, "test"), kPoint) - by_p(info, kPoint)).norm(), 1e-6);
}

TEST(CameraModel, BinningAndRegionOfInterestCount) {
  sensor_msgs::CameraInfo info = full_hd();
  info.binning_x = info.binning_y = 2;
  info.roi.x_offset = 200;
  info.roi.y_offset = 100;
  info.roi.width = 1000;
  info.roi.height = 800;
  const CameraModel model = camera_model(info, {}, "test");
  EXPECT_EQ(model.camera.intrinsics().width, 500);
  EXPECT_EQ(model.camera.intrinsics().height, 400);
  const Eigen::Vector2d whole = pixel_of(camera_model(full_hd(), {}, "test"), kPoint);
  EXPECT_NEAR(pixel_of(model, kPoint).x(), (whole.x() - 200) / 2, 1e-6);
  EXPECT_NEAR(pixel_of(model, kPoint).y(), (whole.y() - 100) / 2, 1e-6);
}

TEST(CameraModel, WhatIsNotKnownIsRefused) {
  const auto reason = [](auto change) -> std::string {
    sensor_msgs::CameraInfo info = full_hd();
    change(info);
    try {
      camera_model(info, {}, "camera_info");
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  using Info = sensor_msgs::CameraInfo;
  EXPECT_EQ(reason([](Info&) {}), "accepted");
  EXPECT_EQ(reason([](Info& i) { i.D.clear(); }), "accepted");
  EXPECT_EQ(reason([](Info& i) { i.R.fill(0.0); }), "accepted");
  EXPECT_EQ(reason([](Info& i) {
              i.distortion_model.clear();
              i.D.assign(100000, 0.0);
            }),
            "accepted");
  EXPECT_NE(reason([](Info& i) {
              i.roi.width = 2147483648U;
              i.binning_x = 4294967295U;
            }).find("'binning_x' is 4294967295, must be <= 65535"),
            std::string::npos);
  EXPECT_NE(reason([](Info& i) { i.distortion_model = "equidistant"; }).find("'equidistant'"),
            std::string::npos);
  EXPECT_NE(reason([](Info& i) { i.distortion_model = ""; }).find("plumb_bob or rational"),
            std::string::npos);
  EXPECT_NE(reason([](Info& i) { i.D.pop_back(); }).find("must have 5"), std::string::npos);
  EXPECT_NE(reason([](Info& i) { i.K.fill(0.0); }).find("not calibrated"), std::string::npos);
  EXPECT_NE(reason([](Info& i) { i.R[0] = 2.0; }).find("not a rotation"), std::string::npos);
}

}  // namespace
}  // namespace usct::ros_interface
