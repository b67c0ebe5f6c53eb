#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <random>

#include "core/io/expect_input_error.h"
#include "core/registration/random_points.h"
#include "us_ct_registration/registration/starts.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

/// Parameters about a turned and shifted pose, with points of unequal extent.
PoseParameters example_pose() {
  Isometry3d initial(Eigen::AngleAxisd(1.1, Vector3d(1, 2, 3).normalized()));
  initial.pretranslate(Vector3d(30, -200, 90));
  std::vector<Vector3d> points = cube_corners(1.0);
  for (Vector3d& point : points)
    point = point.cwiseProduct(Vector3d(20, 40, 60)) + Vector3d(0, 60, 0);
  return PoseParameters(initial, points);
}

/// The motion from the initial pose about the centre.
struct Motion {
  Vector3d rotation_vector_rad;
  Vector3d translation_mm;
};

std::vector<Motion> motions(const PoseParameters& pose, const StartOptions& options) {
  std::vector<Motion> all;
  for (const PoseVector& parameters : spread_starts(pose, options)) {
    const Isometry3d motion = pose.T_us_ct(parameters) * pose.T_us_ct_initial().inverse();
    const Eigen::AngleAxisd turn(motion.linear());
    all.push_back({turn.angle() * turn.axis(), motion * pose.centre_us_mm() - pose.centre_us_mm()});
  }
  return all;
}

TEST(Starts, BeginWithTheInitialPose) {
  for (const StartRegion region : {StartRegion::kBox, StartRegion::kBall}) {
    StartOptions options;
    options.region = region;
    options.count = 256;
    const std::vector<PoseVector> starts = spread_starts(example_pose(), options);
    EXPECT_EQ(starts.size(), 256U);
    EXPECT_EQ(starts.front(), PoseVector::Zero());
    options.count = 1;
    EXPECT_EQ(spread_starts(example_pose(), options).size(), 1U);
  }
}

TEST(Starts, FillTheBoxEvenly) {
  const std::vector<Motion> all =
      motions(example_pose(), {StartRegion::kBox, 256, 20.0 * kDegree, 20.0});
  for (int axis = 0; axis < 3; ++axis) {
    // Each eighth of the width would have 32 starts if all were even; at random these vary by 5.
    std::vector<int> by_rotation(8, 0);
    std::vector<int> by_translation(8, 0);
    for (const Motion& motion : all) {
      const double r = motion.rotation_vector_rad[axis] / (20.0 * kDegree);
      const double t = motion.translation_mm[axis] / 20.0;
      ASSERT_LE(std::abs(r), 1.0 + 1e-9);
      ASSERT_LE(std::abs(t), 1.0 + 1e-9);
      ++by_rotation[static_cast<std::size_t>(std::min(7.0, 4.0 * (r + 1.0)))];
      ++by_translation[static_cast<std::size_t>(std::min(7.0, 4.0 * (t + 1.0)))];
    }
    for (const int count : by_rotation) EXPECT_NEAR(count, 32, 1);
    for (const int count : by_translation) EXPECT_NEAR(count, 32, 1);
  }
}

TEST(Starts, LeaveSmallerGapsThanChance) {
  // Mean distance from anywhere in the box to the nearest start, in half widths. 256 random starts
  // have 0.634, with a standard deviation of 0.0035 (20 draws, computed apart).
  std::vector<PoseVector> starts;
  for (const Motion& motion : motions(example_pose(), StartOptions())) {
    PoseVector start;
    start << motion.rotation_vector_rad / (20.0 * kDegree), motion.translation_mm / 20.0;
    starts.push_back(start);
  }
  std::mt19937 random(7);
  double sum = 0.0;
  constexpr int kProbes = 20000;
  for (int i = 0; i < kProbes; ++i) {
    PoseVector probe;
    for (double& value : probe) value = static_cast<double>(random()) / 2147483648.0 - 1.0;
    double nearest = std::numeric_limits<double>::max();
    for (const PoseVector& start : starts) nearest = std::min(nearest, (probe - start).norm());
    sum += nearest;
  }
  EXPECT_LT(sum / kProbes, 0.62);
}

TEST(Starts, StayInTheBallAndFillIt) {
  StartOptions options;
  options.region = StartRegion::kBall;
  options.count = 512;
  options.rotation_rad = 40.0 * kDegree;
  options.translation_mm = 30.0;
  int far_turns = 0;
  int far_shifts = 0;
  for (const Motion& motion : motions(example_pose(), options)) {
    ASSERT_LE(motion.rotation_vector_rad.norm(), options.rotation_rad + 1e-9);
    ASSERT_LE(motion.translation_mm.norm(), options.translation_mm + 1e-9);
    if (motion.rotation_vector_rad.norm() > 0.5 * options.rotation_rad) ++far_turns;
    if (motion.translation_mm.norm() > 15.0) ++far_shifts;
  }
  // Seven eighths of a ball lie beyond half its radius; of rotations up to 40 degrees,
  // 1 - (a - sin a) / (b - sin b) with a = 20 and b = 40 degrees, 0.8737, lie beyond 20.
  EXPECT_NEAR(far_turns, 0.8737 * 512, 8);
  EXPECT_NEAR(far_shifts, 0.875 * 512, 8);
}

TEST(Starts, AllOrientationsAreCoveredEvenly) {
  StartOptions options;
  options.region = StartRegion::kBall;
  options.count = 2000;
  options.rotation_rad = kPi;
  // Of evenly spread rotations R, the mean of R v is 0 and that of R_ij^2 is 1/3.
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d mean_square = mean;
  for (const Motion& motion : motions(example_pose(), options)) {
    const double angle = motion.rotation_vector_rad.norm();
    const Eigen::Matrix3d R =
        angle == 0.0
            ? Eigen::Matrix3d::Identity().eval()
            : Eigen::AngleAxisd(angle, motion.rotation_vector_rad / angle).toRotationMatrix();
    mean += R / options.count;
    mean_square += R.cwiseAbs2() / options.count;
  }
  EXPECT_LT(mean.cwiseAbs().maxCoeff(), 0.02);
  EXPECT_LT((mean_square.array() - 1.0 / 3.0).abs().maxCoeff(), 0.02);
}

TEST(Starts, MoreOfThemBeginWithTheFewer) {
  StartOptions options;
  options.count = 40;
  const std::vector<PoseVector> few = spread_starts(example_pose(), options);
  options.count = 100;
  const std::vector<PoseVector> many = spread_starts(example_pose(), options);
  for (std::size_t i = 0; i < few.size(); ++i) EXPECT_EQ(few[i], many[i]);
}

/// The rounds of a search take consecutive parts, however many starts there were before.
TEST(Starts, ContinueWhereThePartBeforeEnded) {
  StartOptions options;
  options.count = 100;
  const std::vector<PoseVector> all = spread_starts(example_pose(), options);
  options.count = 30;
  for (const std::size_t first : {0UL, 1UL, 2UL, 30UL, 70UL}) {
    const std::vector<PoseVector> part = spread_starts(example_pose(), options, first);
    ASSERT_EQ(part.size(), 30U);
    for (std::size_t i = 0; i < part.size(); ++i) EXPECT_EQ(part[i], all[first + i]);
  }
  EXPECT_EQ(spread_starts(example_pose(), options, 7000000).size(), 30U);
}

TEST(Starts, BadOptionsAreNamed) {
  const auto expect_refused = [](const std::function<void(StartOptions&)>& spoil,
                                 const std::vector<std::string>& named) {
    StartOptions options;
    spoil(options);
    expect_input_error([&] { spread_starts(example_pose(), options); }, named);
  };
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  expect_refused([](StartOptions& o) { o.count = 0; }, {"'count' is 0", "[1, 1e+06]"});
  expect_refused([](StartOptions& o) { o.count = 2000000000; }, {"'count' is 2e+09"});
  expect_refused([](StartOptions& o) { o.translation_mm = 1e200; },
                 {"'translation_mm' is 1e+200", "[0, 1000]"});
  expect_refused([](StartOptions& o) { o.rotation_rad = -0.1; }, {"'rotation_rad'", "-0.1"});
  expect_refused([](StartOptions& o) { o.rotation_rad = 2.0; }, {"'rotation_rad'", "2", "1.8"});
  expect_refused([](StartOptions& o) { o.rotation_rad = kNaN; }, {"'rotation_rad'", "nan"});
  expect_refused([](StartOptions& o) { o.translation_mm = -1.0; }, {"'translation_mm'", "-1"});
  expect_refused(
      [](StartOptions& o) {
        o.region = StartRegion::kBall;
        o.rotation_rad = 3.2;
      },
      {"'rotation_rad'", "3.2", "3.14"});
}

}  // namespace
}  // namespace usct::test
