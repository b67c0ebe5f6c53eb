#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Cholesky>
#include <limits>
#include <random>

#include "core/geometry/random_geometry.h"
#include "core/io/expect_input_error.h"
#include "core/registration/random_points.h"
#include "us_ct_registration/geometry/target_errors.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

TEST(TargetErrors, OfATranslationAreItsLength) {
  Isometry3d T_true = Isometry3d::Identity();
  T_true.linear() = Eigen::AngleAxisd(1.0, Vector3d(1, 2, -1).normalized()).matrix();
  T_true.translation() = Vector3d(100, -200, 300);
  const Isometry3d T_us_ct = Eigen::Translation3d(2, -3, 6) * T_true;
  const TargetErrors errors = evaluate_targets(T_us_ct, T_true, {{0, 0, 0}, {50, 60, -70}});
  for (const double error :
       {errors.mean_mm, errors.rms_mm, errors.median_mm, errors.max_mm, errors.per_target_mm[1]})
    EXPECT_NEAR(error, 7.0, 1e-12);
}

// A point at distance r from the axis moves by the chord 2 r sin(angle / 2).
TEST(TargetErrors, OfARotationAreChordsAboutItsAxis) {
  Isometry3d T_true = Isometry3d::Identity();
  T_true.linear() = Eigen::AngleAxisd(-2.0, Vector3d(3, 1, 1).normalized()).matrix();
  T_true.translation() = Vector3d(-5, 40, 12);
  const Isometry3d T_error(Eigen::Translation3d(0, 50, 0) *
                           Eigen::AngleAxisd(0.2, Vector3d::UnitZ()) *
                           Eigen::Translation3d(0, -50, 0));
  const TargetErrors errors = evaluate_targets(
      T_error * T_true, T_true, {{10, 50, 3}, {0, 50, 80}, {0, 80, -7}, {24, 82, 0}});
  const double chord = 2.0 * std::sin(0.1);
  const std::vector<double> distances{10, 0, 30, 40};
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(errors.per_target_mm[i], distances[i] * chord, 1e-12) << i;
  EXPECT_NEAR(errors.mean_mm, 20 * chord, 1e-12);
  EXPECT_NEAR(errors.median_mm, 20 * chord, 1e-12);  // between 10 and 30
  EXPECT_NEAR(errors.rms_mm, std::sqrt(2600.0 / 4.0) * chord, 1e-12);
  EXPECT_NEAR(errors.max_mm, 40 * chord, 1e-12);
}

TEST(TargetErrors, MedianOfAnOddNumberIsTheMiddleOne) {
  const Isometry3d T_us_ct(Eigen::AngleAxisd(0.2, Vector3d::UnitZ()));
  const TargetErrors errors =
      evaluate_targets(T_us_ct, Isometry3d::Identity(), {{90, 0, 0}, {1, 0, 0}, {0, 7, 0}});
  EXPECT_NEAR(errors.median_mm, 14.0 * std::sin(0.1), 1e-12);
}

// Two targets, of which the second moved by (0, 3, 4) between the images: the right pose of the
// rest of the body leaves an error of 5 mm there, and no other pose can be free of error.
TEST(TargetErrors, OfMatchedPointsIncludeTheDeformation) {
  Isometry3d T_us_ct = Isometry3d::Identity();
  T_us_ct.linear() = Eigen::AngleAxisd(0.7, Vector3d(2, -1, 1).normalized()).matrix();
  T_us_ct.translation() = Vector3d(20, -300, 70);
  const std::vector<Vector3d> points_ct{{10, 20, 30}, {-40, 5, 60}};
  const TargetErrors errors = evaluate_matched_targets(
      T_us_ct, points_ct, {T_us_ct * points_ct[0], T_us_ct * points_ct[1] + Vector3d(0, 3, 4)});
  EXPECT_NEAR(errors.per_target_mm[0], 0.0, 1e-12);
  EXPECT_NEAR(errors.per_target_mm[1], 5.0, 1e-12);
  EXPECT_NEAR(errors.mean_mm, 2.5, 1e-12);
  EXPECT_NEAR(errors.median_mm, 2.5, 1e-12);
  EXPECT_NEAR(errors.rms_mm, std::sqrt(12.5), 1e-12);
  EXPECT_NEAR(errors.max_mm, 5.0, 1e-12);
}

RC_GTEST_PROP(TargetErrors, OfMatchedPointsAreThoseAgainstTheTruthIfNothingDeformed, ()) {
  const Isometry3d T_us_ct = random_pose(400.0);
  const Isometry3d T_us_ct_true = random_pose(400.0);
  const std::vector<Vector3d> points_us = random_points();
  const TargetErrors matched =
      evaluate_matched_targets(T_us_ct, ct_points_mm(T_us_ct_true, points_us), points_us);
  RC_ASSERT(matched.per_target_mm ==
            evaluate_targets(T_us_ct, T_us_ct_true, points_us).per_target_mm);
  for (std::size_t i = 0; i < points_us.size(); ++i) {
    const Vector3d moved = T_us_ct * T_us_ct_true.inverse() * points_us[i];
    RC_ASSERT(std::abs(matched.per_target_mm[i] - (moved - points_us[i]).norm()) < 1e-9);
  }
}

RC_GTEST_PROP(TargetErrors, DoNotDependOnTheFrameOfTheCt, ()) {
  const Isometry3d T_us_ct = random_pose(400.0);
  const Isometry3d T_us_ct_true = random_pose(400.0);
  const Isometry3d T_ct_other = random_pose(400.0);
  const std::vector<Vector3d> points_us = random_points();
  const TargetErrors errors = evaluate_targets(T_us_ct, T_us_ct_true, points_us);
  const TargetErrors same =
      evaluate_targets(T_us_ct * T_ct_other, T_us_ct_true * T_ct_other, points_us);
  for (std::size_t i = 0; i < points_us.size(); ++i)
    RC_ASSERT(std::abs(errors.per_target_mm[i] - same.per_target_mm[i]) < 1e-9);
  RC_ASSERT(errors.median_mm <= errors.max_mm);
  RC_ASSERT(errors.mean_mm <= errors.rms_mm * (1.0 + 1e-12));
}

Matrix6d random_covariance(std::mt19937& generator) {
  std::normal_distribution<double> normal;
  const Matrix6d factor = Matrix6d::NullaryExpr([&] { return normal(generator); });
  Eigen::Matrix<double, 6, 1> scale;
  scale << 2e-3, 4e-3, 1e-3, 0.3, 0.1, 0.5;  // rad, mm
  return scale.asDiagonal() * Matrix6d(factor * factor.transpose()) * scale.asDiagonal();
}

// Poses are drawn from the covariance and moved by large rotations; their errors are measured as
// those of any result.
TEST(ExpectedTargetErrors, AreWhatRandomPosesHave) {
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  const std::vector<Vector3d> points_us{{0, 80, 10}, {30, 95, -5}, {-20, 60, 0}, {5, 110, 40}};
  const Matrix6d covariance = random_covariance(generator);
  const Matrix6d root = covariance.llt().matrixL();
  Isometry3d T_true = Isometry3d::Identity();
  T_true.translation() = Vector3d(10, 20, 30);

  constexpr int kPoses = 40000;
  std::vector<double> squares(points_us.size(), 0.0);
  for (int i = 0; i < kPoses; ++i) {
    const Eigen::Matrix<double, 6, 1> motion =
        root * Eigen::Matrix<double, 6, 1>::NullaryExpr([&] { return normal(generator); });
    const Vector3d w = motion.head<3>();
    const Isometry3d T_motion =
        Eigen::Translation3d(motion.tail<3>()) * Eigen::AngleAxisd(w.norm(), w.normalized());
    const TargetErrors errors = evaluate_targets(T_motion * T_true, T_true, points_us);
    for (std::size_t p = 0; p < points_us.size(); ++p)
      squares[p] += errors.per_target_mm[p] * errors.per_target_mm[p] / kPoses;
  }
  double mean_square = 0.0;
  for (std::size_t p = 0; p < points_us.size(); ++p) {
    const ExpectedTargetErrors expected = expected_tre_mm(covariance, {points_us[p]});
    EXPECT_NEAR(expected.rms_mm, std::sqrt(squares[p]), 0.02 * expected.rms_mm) << p;
    EXPECT_EQ(expected.rms_mm, expected.max_mm);
    mean_square += squares[p] / static_cast<double>(points_us.size());
  }
  const ExpectedTargetErrors expected = expected_tre_mm(covariance, points_us);
  EXPECT_NEAR(expected.rms_mm, std::sqrt(mean_square), 0.02 * expected.rms_mm);
  EXPECT_NEAR(expected.max_mm, std::sqrt(*std::max_element(squares.begin(), squares.end())),
              0.02 * expected.max_mm);
}

TEST(ExpectedTargetErrors, RotationActsAboutTheOriginOfTheUsFrame) {
  Matrix6d covariance = Matrix6d::Zero();
  covariance(2, 2) = 0.01 * 0.01;  // about z
  const ExpectedTargetErrors errors = expected_tre_mm(covariance, {{0, 0, 50}, {30, 40, 7}});
  EXPECT_NEAR(errors.max_mm, 0.5, 1e-12);
  EXPECT_NEAR(errors.rms_mm, std::sqrt(0.125), 1e-12);
}

TEST(ExpectedTargetErrors, ACorrelationCanHoldATargetStill) {
  // Rotation about an axis through the target: w about z turns (0, 100, 0) by -100 w in x.
  Matrix6d covariance = Matrix6d::Zero();
  Eigen::Matrix<double, 6, 1> motion;
  motion << 0, 0, 0.01, 1, 0, 0;
  covariance = motion * motion.transpose();
  EXPECT_NEAR(expected_tre_mm(covariance, {{0, 100, 0}}).rms_mm, 0.0, 1e-7);
  EXPECT_NEAR(expected_tre_mm(covariance, {{0, 90, 0}}).rms_mm, 0.1, 1e-9);
}

TEST(TargetErrors, RefuseWhatIsNoInput) {
  const Isometry3d T = Isometry3d::Identity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_input_error([&] { evaluate_targets(T, T, {}); }, {"targets", "at least 1"});
  expect_input_error(
      [&] {
        evaluate_targets(T, T, {{0, 0, 0}, {0, nan, 0}});
      },
      {"targets", "point 1"});
  Isometry3d T_bad = T;
  T_bad.translation().x() = nan;
  expect_input_error([&] { evaluate_targets(T, T_bad, {{0, 0, 0}}); }, {"T_us_ct_true", "finite"});
  expect_input_error([&] { evaluate_targets(T_bad, T, {{0, 0, 0}}); }, {"T_us_ct", "finite"});
  expect_input_error(
      [&] {
        evaluate_matched_targets(T, {{0, 0, 0}}, {{0, 0, 0}, {1, 1, 1}});
      },
      {"targets in the CT", "there are 1", "as many as targets, 2"});
  expect_input_error(
      [&] {
        evaluate_matched_targets(T, {{nan, 0, 0}}, {{0, 0, 0}});
      },
      {"targets in the CT", "point 0"});

  const auto refuse = [](int row, int column, double value, const std::string& violation) {
    Matrix6d covariance = Matrix6d::Identity();
    covariance(row, column) = value;
    expect_input_error(
        [&] {
          expected_tre_mm(covariance, {{0, 0, 0}}, "r.json");
        },
        {"r.json", "covariance", violation});
  };
  refuse(3, 3, nan, "finite");
  refuse(3, 3, -1.0, "semidefinite");
  refuse(0, 0, -1e-8, "negative variance");  // of angles in rad: they are that small
  refuse(1, 4, 0.5, "symmetric");
  expect_input_error(
      [] {
        Matrix6d covariance = Matrix6d::Identity();
        covariance(0, 5) = covariance(5, 0) = 1.1;
        expected_tre_mm(covariance, {{0, 0, 0}});
      },
      {"covariance", "semidefinite"});
  expect_input_error([] { expected_tre_mm(Matrix6d::Identity(), {}); }, {"targets"});
}

}  // namespace
}  // namespace usct::test
