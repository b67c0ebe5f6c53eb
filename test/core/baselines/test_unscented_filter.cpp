#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>

#include "core/baselines/surfaces.h"
#include "core/io/expect_input_error.h"
#include "core/registration/random_points.h"
#include "us_ct_registration/baselines/icp.h"
#include "us_ct_registration/baselines/unscented_filter.h"
#include "us_ct_registration/registration/landmarks.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

/// Horn's closed form weighs all points equally and knows no start; the filter's start is so
/// uncertain that it hardly weighs.
RC_GTEST_PROP(UnscentedFilter, AgreesWithHornOnMatchedPointsWithNoise, ()) {
  const Isometry3d T = random_pose(200.0);
  const Points ct = bumpy_ellipsoid(60);
  Points us = moved(T, ct);
  for (Vector3d& p : us) p += random_vector(0.8);
  const Isometry3d start = T *
                           Isometry3d(Eigen::AngleAxisd(uniform(0.0, 0.35), random_direction())) *
                           Eigen::Translation3d(uniform(0.0, 15.0) * random_direction());
  const UnscentedFilterResult result = filter_pairs(us, ct, start);
  const LandmarkAlignment horn = align_landmarks(us, ct);
  RC_ASSERT(rms_displacement_mm(result.T_us_ct, horn.T_target_source, ct) < 0.03);
  RC_ASSERT(std::abs(result.distance_mm - horn.residual_mm) < 2e-3);
}

/// The uncertainty that the filter states is the error over repeated noise.
TEST(UnscentedFilter, StatesItsErrorAndShrinksItWithEveryPoint) {
  constexpr int kTrials = 300;
  const Points ct = bumpy_ellipsoid(40);
  UnscentedFilterOptions options;
  options.point_deviation_mm = 0.7;
  options.passes = 3;
  std::mt19937 random(11);
  std::normal_distribution<double> normal(0.0, 0.7);
  double square = 0.0;
  UnscentedFilterResult result;
  for (int trial = 0; trial < kTrials; ++trial) {
    Points us = ct;
    for (Vector3d& p : us) p += Vector3d(normal(random), normal(random), normal(random));
    result = filter_pairs(us, ct, Isometry3d::Identity(), options);
    Vector3d centroid = Vector3d::Zero();
    for (const Vector3d& p : ct) centroid += p / static_cast<double>(ct.size());
    square += (result.T_us_ct * centroid - centroid).squaredNorm() / kTrials;
  }
  // The centroid of 40 points, along three axes.
  EXPECT_NEAR(result.shift_deviations_mm.back(), 0.7 * std::sqrt(3.0 / 40.0), 0.004);
  EXPECT_NEAR(std::sqrt(square) / result.shift_deviations_mm.back(), 1.0, 0.08);
  ASSERT_EQ(result.shift_deviations_mm.size(), 40U);
  for (std::size_t i = 1; i < 40; ++i)
    EXPECT_LT(result.shift_deviations_mm[i], result.shift_deviations_mm[i - 1]);
}

TEST(UnscentedFilter, FindsTheSurfacePoseThatIcpFinds) {
  const Points ct = bumpy_ellipsoid(1500);
  const Isometry3d T = Eigen::Translation3d(10, 20, 60) * Eigen::AngleAxisd(0.5, Vector3d::UnitY());
  // Every third point, so that nearest points can be the same ones, and both end without error.
  Points us;
  for (std::size_t i = 0; i < ct.size(); i += 3) us.push_back(T * ct[i]);
  const Isometry3d start = T * Isometry3d(Eigen::AngleAxisd(0.1, Vector3d(1, 2, 3).normalized())) *
                           Eigen::Translation3d(3, -2, 2);
  const IcpResult by_icp = icp(us, ct, start);
  const UnscentedFilterResult by_filter = filter_surfaces(us, ct, start);
  EXPECT_GT(rms_displacement_mm(start, T, ct), 4.0);
  EXPECT_LT(rms_displacement_mm(by_icp.T_us_ct, T, ct), 0.05);
  EXPECT_LT(rms_displacement_mm(by_filter.T_us_ct, by_icp.T_us_ct, ct), 0.1);
}

TEST(UnscentedFilter, BadInputIsNamed) {
  const Points points = bumpy_ellipsoid(30);
  const Isometry3d start = Isometry3d::Identity();
  expect_input_error([&] { filter_pairs(points, bumpy_ellipsoid(29), start); },
                     {"30 of the ultrasound and 29 of the CT"});
  expect_input_error(
      [&] {
        filter_surfaces(points, {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, start);
      },
      {"CT points", "lie on a line"});
  expect_input_error([&] { filter_surfaces(points, {}, start); }, {"CT points", "0 points"});
  UnscentedFilterOptions options;
  options.passes = 0;
  expect_input_error([&] { filter_pairs(points, points, start, options); }, {"passes", "0"});
  options = {};
  options.point_deviation_mm = 0.0;
  expect_input_error([&] { filter_pairs(points, points, start, options); },
                     {"point_deviation_mm", "0"});
}

}  // namespace
}  // namespace usct::test
