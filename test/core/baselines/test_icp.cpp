#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>

#include "core/baselines/surfaces.h"
#include "core/io/expect_input_error.h"
#include "core/registration/random_points.h"
#include "us_ct_registration/baselines/icp.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

/// A turn of `degrees` about an axis and a shift.
Isometry3d motion(const Vector3d& axis, double degrees, const Vector3d& shift_mm) {
  Isometry3d T(Eigen::AngleAxisd(degrees * EIGEN_PI / 180.0, axis.normalized()));
  T.pretranslate(shift_mm);
  return T;
}

Points noisy(Points points, double deviation_mm, std::mt19937& random) {
  std::normal_distribution<double> normal;
  for (Vector3d& p : points)
    p += deviation_mm * Vector3d(normal(random), normal(random), normal(random));
  return points;
}

/// An open cylinder about z.
Points cylinder(double radius_mm, double half_length_mm) {
  Points points;
  for (double z = -half_length_mm; z <= half_length_mm; z += 2.0)
    for (int i = 0; i < 80; ++i) {
      const double angle = 2.0 * EIGEN_PI * (i + 0.37 * z) / 80.0;
      points.emplace_back(radius_mm * std::cos(angle), radius_mm * std::sin(angle), z);
    }
  return points;
}

RC_GTEST_PROP(Icp, FindsAKnownMotionToTheNumericalLimit, ()) {
  const Points ct = bumpy_ellipsoid(1500);
  const Isometry3d T = random_pose(200.0);
  const Isometry3d start =
      T * motion(random_direction(), uniform(0.0, 12.0), uniform(0.0, 8.0) * random_direction());
  IcpOptions options;
  options.tolerance_mm = 1e-10;
  const IcpResult result = icp(moved(T, ct), ct, start, options);
  RC_ASSERT(result.converged);
  RC_ASSERT(rms_displacement_mm(result.T_us_ct, T, ct) < 1e-7);
  RC_ASSERT(result.distance_mm < 1e-7);
  RC_ASSERT(result.pairs == 1500);
  RC_ASSERT(!result.undetermined());
}

/// The mean square error over repeated noise is the one that the covariance predicts.
TEST(Icp, PredictsTheErrorThatNoiseMakes) {
  constexpr int kTrials = 60;
  const Points ct = bumpy_ellipsoid(12000);
  const Points clean = bumpy_ellipsoid(400);
  const Isometry3d T = motion({1, 2, -1}, 40.0, {20, -30, 90});
  std::mt19937 random(3);
  double square = 0.0;
  double predicted = 0.0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const IcpResult result = icp(noisy(moved(T, clean), 0.5, random), ct, T);
    ASSERT_TRUE(result.converged);
    EXPECT_NEAR(result.plane_distance_mm, 0.5, 0.08);
    square += std::pow(rms_displacement_mm(result.T_us_ct, T, clean), 2.0) / kTrials;
    predicted += std::pow(result.predicted_error_mm, 2.0) / kTrials;
  }
  // 60 errors of six degrees of freedom each: their mean square is known to about 10 %.
  EXPECT_NEAR(std::sqrt(square / predicted), 1.0, 0.15);
  EXPECT_LT(std::sqrt(square), 0.2);
}

TEST(Icp, PartsThatTheCtDoesNotShowAreTrimmed) {
  const Points us = bumpy_ellipsoid(1500);
  Points ct;
  for (const Vector3d& p : us)
    if (p.x() > -20.0) ct.push_back(p);
  const Isometry3d T = motion({0, 1, 1}, 25.0, {5, 8, 60});
  const Isometry3d start = T * motion({1, 0, 1}, 5.0, {3, -2, 2});
  IcpOptions options;
  const IcpResult whole = icp(moved(T, us), ct, start, options);
  EXPECT_GT(rms_displacement_mm(whole.T_us_ct, T, ct), 0.5);
  options.overlap = 0.6;
  options.tolerance_mm = 1e-9;
  const IcpResult trimmed = icp(moved(T, us), ct, start, options);
  EXPECT_TRUE(trimmed.converged);
  EXPECT_EQ(trimmed.pairs, 900);
  EXPECT_LT(rms_displacement_mm(trimmed.T_us_ct, T, ct), 1e-6);
  // Parts that the ultrasound alone lacks need none.
  const IcpResult partial = icp(moved(T, ct), us, start);
  EXPECT_LT(rms_displacement_mm(partial.T_us_ct, T, ct), 1e-4);
}

/// What an alignment leaves out speaks against it: half of a kidney that lies the wrong way round
/// may have smaller distances than the right alignment with all of it.
TEST(Icp, TellsTheDistanceOfAllPointsFromWhichPairsAreLeftOut) {
  const Points ct = bumpy_ellipsoid(1500);
  IcpOptions options;
  options.overlap = 0.5;
  options.largest_distance_mm = 4.0;
  options.largest_iterations = 1;
  const IcpResult right = icp(ct, ct, Isometry3d::Identity(), options);
  EXPECT_NEAR(right.capped_distance_mm, 0.0, 1e-9);
  Points with_far = ct;
  for (Vector3d p : ct) with_far.push_back(p + Vector3d(0, 0, 500));
  const IcpResult half = icp(with_far, ct, Isometry3d::Identity(), options);
  EXPECT_NEAR(half.distance_mm, 0.0, 1e-6);
  EXPECT_NEAR(half.capped_distance_mm, 4.0 / std::sqrt(2.0), 1e-6);
}

TEST(Icp, AMotionThatTheSurfacesLeaveOpenIsNamed) {
  const Isometry3d start = motion({0, 1, 0}, 10.0, {1, 1, 1});
  for (const double noise_mm : {0.0, 0.3}) {
    std::mt19937 random(5);
    const Points sphere = noisy(ellipsoid({30, 30, 30}, 1500), noise_mm, random);
    const IcpResult ball =
        icp(noisy(ellipsoid({30, 30, 30}, 700), noise_mm, random), sphere, start);
    EXPECT_TRUE(ball.undetermined()) << ball.least_information << " " << ball.information_floor;
    EXPECT_GT(30.0 * ball.least_determined.turn.norm(), 0.95);
    EXPECT_LT(ball.least_determined.shift.norm(), 0.3);
    EXPECT_LT(ball.centre_us_mm.norm(), 0.2);

    const Points tube = noisy(cylinder(25.0, 50.0), noise_mm, random);
    const IcpResult slid =
        icp(noisy(cylinder(25.0, 30.0), noise_mm, random), tube, motion({1, 1, 0}, 3.0, {1, 1, 1}));
    EXPECT_TRUE(slid.undetermined()) << slid.least_information << " " << slid.information_floor;
    // The tube slides along its axis and turns about it: nothing moves across.
    EXPECT_LT(slid.least_determined.shift.head<2>().norm(), 0.1);
    EXPECT_LT(25.0 * slid.least_determined.turn.head<2>().norm(), 0.1);

    const IcpResult kidney = icp(noisy(bumpy_ellipsoid(700), noise_mm, random),
                                 noisy(bumpy_ellipsoid(1500), noise_mm, random), start);
    EXPECT_FALSE(kidney.undetermined())
        << kidney.least_information << " " << kidney.information_floor;
  }
}

TEST(Icp, SurfacesWithoutOverlapAndBadOptionsAreRefused) {
  const Points surface = bumpy_ellipsoid(300);
  const Isometry3d identity = Isometry3d::Identity();
  const Isometry3d far = motion({0, 0, 1}, 0.0, {200, 0, 0});
  expect_input_error([&] { icp(surface, surface, far); },
                     {"within 30 mm", "must be at least 20", "do not overlap"});
  IcpOptions options;
  options.overlap = 1.2;
  expect_input_error([&] { icp(surface, surface, identity, options); }, {"overlap", "1.2"});
  expect_input_error([&] { icp(Points(19), surface, identity); },
                     {"ultrasound surface", "19 points, must be at least 20"});
  expect_input_error([&] { icp(surface, Points(30, Vector3d(1, 2, 3)), identity); },
                     {"CT surface", "lie on a line"});
  options = {};
  options.largest_iterations = 1;
  EXPECT_FALSE(icp(surface, surface, motion({1, 0, 0}, 8.0, {3, 3, 3}), options).converged);
}

}  // namespace
}  // namespace usct::test
