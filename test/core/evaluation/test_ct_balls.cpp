#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/io/expect_input_error.h"
#include "core/registration/random_points.h"
#include "us_ct_registration/evaluation/ball_detection.h"

namespace usct::test {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

/// A ball of value 1 under a Gaussian blur, at a distance from its centre; in closed form.
double blurred_ball(double distance_mm, double radius_mm, double sigma_mm) {
  const double rho = std::max(distance_mm, 1e-6);
  const double width = std::sqrt(2.0) * sigma_mm;
  const double below = (radius_mm - rho) / width;
  const double above = (radius_mm + rho) / width;
  return 0.5 * (std::erf(below) + std::erf(above)) -
         sigma_mm / (rho * std::sqrt(2.0 * EIGEN_PI)) *
             (std::exp(-below * below) - std::exp(-above * above));
}

struct Imaging {
  double diameter_mm = 1.0;
  double steel_hu = 3000.0;
  double sigma_mm = 0.45;
  double noise_hu = 10.0;
  double streak_hu = 0.0;
};

/// A CT of balls in water with the spacing of a clinical CT. Positions are in units of voxels; each
/// voxel is the mean over its extent, and values end at 3071 HU, as in scanners.
CtVolume ct_of(const Points& balls, const Imaging& imaging, const Grid& grid) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, imaging.noise_hu);
  CtVolume ct(grid);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        double hu = noise(random);
        for (const Vector3d& ball : balls) {
          const Vector3d offset = (Vector3d(i, j, k) - ball).cwiseProduct(grid.spacing_mm);
          // Metal darkens and brightens the slices along rays through it.
          const double angle = std::atan2(offset.y(), offset.x());
          if (std::abs(offset.z()) < 1.0)
            hu += imaging.streak_hu * std::cos(8.0 * angle) / (1.0 + offset.head<2>().norm());
          if (offset.norm() > imaging.diameter_mm + 5.0 * imaging.sigma_mm) continue;
          for (int part = 0; part < 27; ++part) {
            const Vector3d shift =
                Vector3d(part % 3, part / 3 % 3, part / 9).array() / 3.0 - 1 / 3.0;
            hu += imaging.steel_hu / 27.0 *
                  blurred_ball((offset + shift.cwiseProduct(grid.spacing_mm)).norm(),
                               0.5 * imaging.diameter_mm, imaging.sigma_mm);
          }
        }
        ct.at(i, j, k) = static_cast<std::int16_t>(std::clamp(hu, -1024.0, 3071.0));
      }
  return ct;
}

Grid clinical_grid(const Eigen::Vector3i& size = {64, 60, 32}) {
  Grid grid;
  grid.size = size;
  grid.spacing_mm = Vector3d(0.468, 0.468, 1.0);
  grid.origin_mm = Vector3d(-30.0, 12.0, -400.0);
  grid.direction = Eigen::AngleAxisd(0.2, Vector3d(1, 2, 3).normalized()).matrix();
  return grid;
}

/// The largest distance, in voxels along an axis, of a ball from the nearest of those detected.
double largest_error(const Points& balls, const BallDetection& found, const Grid& grid) {
  double largest = 0.0;
  for (const Vector3d& ball : balls) {
    double least = 1e9;
    for (const DetectedBall& one : found.balls)
      least =
          std::min(least, (grid.index_from_physical(one.centre_mm) - ball).cwiseAbs().maxCoeff());
    largest = std::max(largest, least);
  }
  return largest;
}

RC_GTEST_PROP(CtBalls, AreFoundToATenthOfAVoxel, ()) {
  const Grid grid = clinical_grid();
  Imaging imaging;
  imaging.diameter_mm = uniform(1.0, 3.0);
  Points balls;
  for (const Vector3d& base : Points{{14, 15, 8}, {48, 13, 9}, {15, 46, 22}, {47, 44, 20}})
    balls.push_back(base + random_vector(1.0));
  CtBallOptions options;
  options.diameter_mm = imaging.diameter_mm;
  const BallDetection found = detect_balls(ct_of(balls, imaging, grid), options);
  RC_ASSERT(found.balls.size() == balls.size());
  RC_ASSERT(found.refused.empty());
  RC_ASSERT(largest_error(balls, found, grid) < 0.1);
}

TEST(CtBalls, AreFoundInSpiteOfSaturationAndStreaks) {
  Imaging imaging;
  imaging.diameter_mm = 2.0;
  imaging.steel_hu = 12000.0;
  imaging.streak_hu = 300.0;
  const Points balls{{14.3, 15.6, 8.2}, {48.4, 13.1, 9.5}, {15.7, 46.2, 22.3}, {47.1, 44.4, 20.8}};
  const CtVolume ct = ct_of(balls, imaging, clinical_grid());
  EXPECT_EQ(*std::max_element(ct.voxels.begin(), ct.voxels.end()), 3071);
  CtBallOptions options;
  options.diameter_mm = 2.0;
  const BallDetection found = detect_balls(ct, options);
  EXPECT_EQ(found.balls.size(), 4U);
  EXPECT_LT(largest_error(balls, found, ct.grid), 0.1);
}

TEST(CtBalls, TouchingBallsAreSeparatedIfTheImageResolvesThem) {
  const Grid grid = clinical_grid();
  Imaging imaging;
  imaging.diameter_mm = 3.0;
  CtBallOptions options;
  options.diameter_mm = 3.0;
  const Vector3d first(20.3, 20.6, 14.2);
  for (const Vector3d& way : Points{{3, 0, 0}, {2, 1, 2}, {0, 0, 3}}) {
    const Vector3d touching = first + (3.0 * way.normalized()).cwiseQuotient(grid.spacing_mm);
    const Points balls{first, touching};
    const BallDetection found = detect_balls(ct_of(balls, imaging, grid), options);
    EXPECT_EQ(found.balls.size(), 2U);
    EXPECT_TRUE(found.refused.empty());
    EXPECT_LT(largest_error(balls, found, grid), 0.2) << way.transpose();
  }
}

/// Two balls of 1 mm that touch across slices of 1 mm have one maximum.
TEST(CtBalls, TouchingBallsThatAreNotResolvedAreRefused) {
  const Grid grid = clinical_grid();
  const Points balls{{14.3, 15.6, 8.2},
                     {48.4, 13.1, 9.5},
                     {15.7, 46.2, 22.3},
                     {47.1, 44.4, 20.3},
                     {47.1, 44.4, 21.3}};
  const BallDetection found = detect_balls(ct_of(balls, {}, grid), CtBallOptions{});
  EXPECT_EQ(found.balls.size(), 3U);
  ASSERT_EQ(found.refused.size(), 1U);
  EXPECT_NE(found.refused[0].reason.find("times"), std::string::npos) << found.refused[0].reason;
  EXPECT_LT(
      (grid.index_from_physical(found.refused[0].centre_mm) - Vector3d(47.1, 44.4, 20.8)).norm(),
      0.2);
}

TEST(CtBalls, ABallCutByTheBorderIsRefusedAndNamed) {
  const Grid grid = clinical_grid();
  Imaging imaging;
  imaging.diameter_mm = 2.0;
  CtBallOptions options;
  options.diameter_mm = 2.0;
  const Points balls{{20.0, 20.0, 15.0}, {63.2, 30.0, 10.0}, {40.0, 30.0, 31.2}, {30.0, 45.0, 1.4}};
  const BallDetection found = detect_balls(ct_of(balls, imaging, grid), options);
  ASSERT_EQ(found.balls.size(), 1U);
  EXPECT_LT(largest_error({balls[0]}, found, grid), 0.1);
  EXPECT_EQ(found.refused.size(), 3U);
  for (const RefusedBall& one : found.refused)
    EXPECT_EQ(one.reason, "is cut by the border of the CT");
}

/// Bone, a contrasted vessel and a needle are no balls.
TEST(CtBalls, OtherBrightObjectsAreNoBalls) {
  const Grid grid = clinical_grid();
  const Points balls{{14.3, 15.6, 8.2}};
  CtVolume ct = ct_of(balls, {}, grid);
  for (int k = 12; k < 30; ++k)
    for (int j = 30; j < 55; ++j)
      for (int i = 5; i < 25; ++i) ct.at(i, j, k) = 1400;
  for (int j = 5; j < 55; ++j)
    for (int i = 40; i < 43; ++i) ct.at(i, j, 16) = 450;
  for (int i = 35; i < 60; ++i) ct.at(i, 20, 5) = 3071;
  const BallDetection found = detect_balls(ct, CtBallOptions{});
  ASSERT_EQ(found.balls.size(), 1U);
  EXPECT_LT(largest_error(balls, found, grid), 0.1);
}

TEST(CtBalls, BadOptionsAreNamed) {
  const CtVolume ct = ct_of({}, {}, clinical_grid({8, 8, 8}));
  EXPECT_TRUE(detect_balls(ct, CtBallOptions{}).balls.empty());
  CtBallOptions options;
  options.diameter_mm = 0.5;
  expect_input_error([&] { detect_balls(ct, options); }, {"CT", "1 mm long", "0.5 mm"});
  options.diameter_mm = 20.0;
  expect_input_error([&] { detect_balls(ct, options); }, {"diameter_mm", "20"});
}

}  // namespace
}  // namespace usct::test
