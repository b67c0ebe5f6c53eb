#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>

#include "core/baselines/surfaces.h"
#include "core/io/expect_input_error.h"
#include "core/registration/random_points.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/evaluation/fiducial_standard.h"
#include "us_ct_registration/evaluation/surface_standard.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

const Points kFiducialsCt{{0, 0, 0}, {40, 5, -3}, {-8, 55, 10}, {15, 20, 60}, {50, 45, 30}};

RC_GTEST_PROP(FiducialStandard, ExactFiducialsHaveNoError, ()) {
  const Isometry3d T = random_pose(300.0);
  const FiducialStandard standard = fiducial_standard(moved(T, kFiducialsCt), kFiducialsCt);
  RC_ASSERT((standard.T_us_ct.matrix() - T.matrix()).norm() < 1e-8);
  RC_ASSERT(standard.fre_mm < 1e-9);
  RC_ASSERT(standard.predicted_tre_mm(random_vector(200.0)) < 1e-8);
}

/// 4000 localizations with a known error: the mean squares of residuals, and of the errors at the
/// targets, are those that the theory states.
TEST(FiducialStandard, PredictsTheErrorsOfRepeatedLocalizations) {
  constexpr int kTrials = 4000;
  constexpr double kDeviationMm = 0.4;  // along each axis, both images together
  const double true_fle_mm = std::sqrt(3.0) * kDeviationMm;
  Isometry3d T(Eigen::AngleAxisd(0.7, Vector3d(1, 2, -1).normalized()));
  T.pretranslate(Vector3d(20, -30, 90));
  const Points true_us = moved(T, kFiducialsCt);
  const Points targets_ct{{20, 20, 20}, {100, 0, 0}, {-60, 80, 150}};
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0.0, kDeviationMm);
  double fle_square = 0.0;
  std::vector<double> tre_square(targets_ct.size(), 0.0);
  std::vector<double> predicted_square(targets_ct.size(), 0.0);
  for (int trial = 0; trial < kTrials; ++trial) {
    Points us = true_us;
    for (Vector3d& p : us) p += Vector3d(normal(random), normal(random), normal(random));
    const FiducialStandard standard = fiducial_standard(us, kFiducialsCt);
    fle_square += standard.fle_mm * standard.fle_mm / kTrials;
    for (std::size_t i = 0; i < targets_ct.size(); ++i) {
      tre_square[i] +=
          (standard.T_us_ct * targets_ct[i] - T * targets_ct[i]).squaredNorm() / kTrials;
      predicted_square[i] += std::pow(standard.predicted_tre_mm(T * targets_ct[i]), 2.0) / kTrials;
    }
  }
  EXPECT_NEAR(std::sqrt(fle_square) / true_fle_mm, 1.0, 0.02);
  for (std::size_t i = 0; i < targets_ct.size(); ++i)
    EXPECT_NEAR(std::sqrt(predicted_square[i] / tre_square[i]), 1.0, 0.03) << i;
}

TEST(FiducialStandard, AWronglyMatchedFiducialShowsWhenItIsLeftOut) {
  Points us = kFiducialsCt;
  us[2] += Vector3d(0, 0, 9.0);
  const FiducialStandard standard = fiducial_standard(us, kFiducialsCt);
  for (std::size_t i = 0; i < us.size(); ++i) {
    ASSERT_TRUE(standard.fiducials[i].left_out_mm);
    if (i != 2) {
      EXPECT_LT(standard.fiducials[i].residual_mm, standard.fiducials[2].residual_mm);
    }
  }
  EXPECT_NEAR(*standard.fiducials[2].left_out_mm, 9.0, 1e-9);
  // The others determine an alignment only if three are left, and not on a line.
  Points three(kFiducialsCt.begin(), kFiducialsCt.begin() + 3);
  EXPECT_FALSE(fiducial_standard(three, three).fiducials[0].left_out_mm);
  Points line{{0, 0, 0}, {10, 0, 0}, {20, 0, 0}, {5, 30, 0}};
  EXPECT_FALSE(fiducial_standard(line, line).fiducials[3].left_out_mm);
  EXPECT_TRUE(fiducial_standard(line, line).fiducials[0].left_out_mm);
}

RC_GTEST_PROP(SurfaceStandard, FindsAPoseOfAnAsymmetricSurface, ()) {
  const Points ct = ellipsoid({55.0, 30.0, 22.0}, 800, 0.7);
  const Isometry3d T = random_pose(300.0);
  const SurfaceStandard standard = surface_standard(moved(T, ct), ct);
  RC_ASSERT((standard.alignments[0].T_us_ct.matrix() - T.matrix()).norm() < 1e-6);
  RC_ASSERT(standard.alignments[0].distance_mm < 1e-6);
  RC_ASSERT(standard.distinction() > 1.2);
  for (const SurfaceAlignment& one : standard.alignments)
    RC_ASSERT(std::abs(one.T_us_ct.linear().determinant() - 1.0) < 1e-9);
}

TEST(SurfaceStandard, TellsThatASymmetricSurfaceIsAmbiguous) {
  const Points us = ellipsoid({55.0, 30.0, 22.0}, 1500);
  // Other points of the same surface: no alignment has a distance of 0.
  const SurfaceStandard standard = surface_standard(us, ellipsoid({55.0, 30.0, 22.0}, 1400));
  EXPECT_LT(standard.distinction(), 1.2);
  EXPECT_GT(standard.roundness_ratio(), 1.2);
  EXPECT_LT(surface_standard(us, ellipsoid({55.0, 30.0, 29.9}, 1400)).roundness_ratio(), 1.05);
  // The points of an ellipsoid's surface at even parameters have variances of a third of the
  // squares.
  EXPECT_NEAR(standard.deviations_us_mm[2], 55.0 / std::sqrt(3.0), 0.3);
  EXPECT_NEAR(standard.deviations_us_mm[0], 22.0 / std::sqrt(3.0), 0.3);
}

TEST(SurfaceStandard, AxesAreBroughtTogetherInEveryOrderAndDirection) {
  const std::vector<Isometry3d> alignments =
      axis_alignments(ellipsoid({55.0, 30.0, 22.0}, 800), ellipsoid({55.0, 30.0, 22.0}, 800));
  ASSERT_EQ(alignments.size(), 24U);
  for (std::size_t i = 0; i < alignments.size(); ++i) {
    const Eigen::Matrix3d R = alignments[i].linear();
    EXPECT_NEAR(R.determinant(), 1.0, 1e-9);
    EXPECT_NEAR(R.cwiseAbs().sum(), 3.0, 0.1);  // an axis of the one on each axis of the other
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_GT((R - alignments[j].linear()).norm(), 1.0) << i << " " << j;
  }
}

TEST(GoldStandards, BadPointsAreNamed) {
  expect_input_error([] { fiducial_standard(kFiducialsCt, Points(4), "us.csv", "ct.csv"); },
                     {"us.csv: has 5 points", "as many as ct.csv, 4"});
  expect_input_error(
      [] {
        surface_standard(Points(9), ellipsoid({9, 8, 7}, 50));
      },
      {"ultrasound surface", "9 points, must be at least 10"});
  expect_input_error(
      [] {
        surface_standard(ellipsoid({9, 8, 7}, 50), Points(50, Vector3d(1, 2, 3)));
      },
      {"CT surface", "lie on a line"});
}

}  // namespace
}  // namespace usct::test
