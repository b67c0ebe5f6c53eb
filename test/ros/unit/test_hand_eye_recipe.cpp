#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <opencv2/calib3d.hpp>
#include <random>

#include "us_ct_registration/geometry/angles.h"

/// The recipe of docs/integration.md for the hand-eye calibration, on an arm with a remote centre
/// of motion whose poses, and those of the board, have errors.
namespace usct::ros_interface {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;

struct Poses {
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;

  void add(const Isometry3d& T) {
    cv::Mat R(3, 3, CV_64F);
    cv::Mat t(3, 1, CV_64F);
    for (int i = 0; i < 3; ++i) {
      t.at<double>(i) = T.translation()[i];
      for (int j = 0; j < 3; ++j) R.at<double>(i, j) = T.linear()(i, j);
    }
    rotations.push_back(R);
    translations.push_back(t);
  }
};

class HandEyeRecipe : public testing::Test {
 protected:
  Isometry3d error(double mm, double deg) {
    const Vector3d turn = radians(deg) * normal_vector();
    return Translation3d(mm * normal_vector()) * AngleAxisd(turn.norm(), turn.stableNormalized());
  }
  Vector3d normal_vector() { return {normal_(random_), normal_(random_), normal_(random_)}; }
  double uniform() { return std::uniform_real_distribution<double>(-1.0, 1.0)(random_); }

  /// The error of the camera's position in the frame of the tip, mm, from 15 poses that tilt the
  /// shaft by up to `tilt_deg`; `noise` 0: exact poses.
  Vector3d error_of_calibration(double tilt_deg, double noise) {
    Poses tip;
    Poses board;
    for (int i = 0; i < 15; ++i) {
      const Isometry3d T_base_tip =
          AngleAxisd(radians(tilt_deg) * uniform(), Vector3d::UnitY()) *
          Isometry3d(AngleAxisd(radians(tilt_deg) * uniform(), Vector3d::UnitX())) *
          Translation3d(0.0, 0.0, 120.0 + 30.0 * uniform()) *
          AngleAxisd(radians(90.0) * uniform(), Vector3d::UnitZ());
      const Isometry3d T_camera_board =
          (T_base_tip * T_tip_camera_).inverse() * Translation3d(5.0, 3.0, 260.0);
      tip.add(T_base_tip * error(0.3 * noise, 0.1 * noise));
      board.add(T_camera_board * error(0.2 * noise, 0.1 * noise));
    }
    cv::Mat R;
    cv::Mat t;
    cv::calibrateHandEye(tip.rotations, tip.translations, board.rotations, board.translations, R, t,
                         cv::CALIB_HAND_EYE_PARK);
    return Vector3d(t.at<double>(0), t.at<double>(1), t.at<double>(2)) -
           T_tip_camera_.translation();
  }

  /// Root mean squares of the error, and of its part along the shaft, mm.
  std::pair<double, double> rms(double tilt_deg) {
    constexpr int kTrials = 200;
    Vector3d squares = Vector3d::Zero();
    for (int i = 0; i < kTrials; ++i)
      squares += error_of_calibration(tilt_deg, 1.0).cwiseAbs2() / kTrials;
    return {std::sqrt(squares.sum()), std::sqrt(squares.z())};
  }

  std::mt19937 random_{1};
  std::normal_distribution<double> normal_;
  const Isometry3d T_tip_camera_ = Translation3d(-2.2, 1.5, 6.0) *
                                   Isometry3d(AngleAxisd(radians(30.0), Vector3d::UnitX())) *
                                   AngleAxisd(0.02, Vector3d::UnitZ());
};

TEST_F(HandEyeRecipe, IsExactForExactPoses) {
  EXPECT_LT(error_of_calibration(35.0, 0.0).norm(), 1e-6);
}

TEST_F(HandEyeRecipe, NeedsPosesThatTurnAboutTwoAxes) {
  const auto [all_mm, along_mm] = rms(35.0);
  const auto [all_narrow_mm, along_narrow_mm] = rms(10.0);
  std::printf("tilted by 35 degrees: %.2f mm, along the shaft %.2f mm; by 10: %.2f mm, %.2f mm\n",
              all_mm, along_mm, all_narrow_mm, along_narrow_mm);
  EXPECT_LT(all_mm, 0.5);
  EXPECT_GT(all_narrow_mm, 2.0 * all_mm);
  EXPECT_GT(along_narrow_mm, 0.8 * all_narrow_mm);
}

}  // namespace
}  // namespace usct::ros_interface
