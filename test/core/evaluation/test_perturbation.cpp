#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <set>

#include "core/io/expect_input_error.h"
#include "core/registration/random_points.h"
#include "us_ct_registration/evaluation/perturbation.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

double moved_mm(const Isometry3d& motion, const std::vector<Vector3d>& points) {
  double sum = 0.0;
  for (const Vector3d& p : points) sum += (motion * p - p).norm();
  return sum / static_cast<double>(points.size());
}

double angle_of(const Isometry3d& motion) { return Eigen::AngleAxisd(motion.linear()).angle(); }

RC_GTEST_PROP(RandomMotion, MovesThePointsByExactlyTheDisplacement, ()) {
  const std::vector<Vector3d> points = random_points();
  const double displacement = uniform(0.0, 120.0);
  const double max_rotation = uniform(0.0, kPi);
  const auto seed = static_cast<std::uint64_t>(integer(0, 1000000));
  const Isometry3d motion = random_motion(seed, points, displacement, max_rotation);
  RC_ASSERT(std::abs(moved_mm(motion, points) - displacement) < 1e-9);
  RC_ASSERT(angle_of(motion) <= max_rotation + 1e-7);
  RC_ASSERT((motion.linear().transpose() * motion.linear()).isIdentity(1e-12));
  RC_ASSERT(random_motion(seed, points, displacement, max_rotation).matrix() == motion.matrix());
  RC_ASSERT(random_motion(seed + 1, points, displacement + 0.1, max_rotation).matrix() !=
            motion.matrix());
}

// If the displacement is no limit, angles are uniform and directions cover the sphere.
TEST(RandomMotion, AnglesAreUniformAndDirectionsIsotropic) {
  const std::vector<Vector3d> points = cube_corners(30.0);
  constexpr int kCount = 4000;
  const double max_rotation = 0.4;
  Vector3d axes = Vector3d::Zero();
  Eigen::Matrix3d axes_squared = Eigen::Matrix3d::Zero();
  Vector3d directions = Vector3d::Zero();
  double mean_angle = 0.0;
  double square_angle = 0.0;
  for (int i = 0; i < kCount; ++i) {
    const Isometry3d motion =
        random_motion(static_cast<std::uint64_t>(i), points, 80.0, max_rotation);
    const Eigen::AngleAxisd turn(motion.linear());
    axes += turn.axis() / kCount;
    axes_squared += turn.axis() * turn.axis().transpose() / kCount;
    directions += motion.translation().normalized() / kCount;
    mean_angle += turn.angle() / kCount;
    square_angle += turn.angle() * turn.angle() / kCount;
  }
  const double tolerance = 4.0 / std::sqrt(3.0 * kCount);
  EXPECT_LT(axes.cwiseAbs().maxCoeff(), tolerance);
  EXPECT_LT(directions.cwiseAbs().maxCoeff(), tolerance);
  EXPECT_TRUE(axes_squared.isApprox(Eigen::Matrix3d::Identity() / 3.0, 0.05)) << axes_squared;
  EXPECT_NEAR(mean_angle, max_rotation / 2.0, 0.01);
  EXPECT_NEAR(square_angle, max_rotation * max_rotation / 3.0, 0.004);
}

TEST(RandomMotionInBox, StaysInTheBoxAndReachesItsFaces) {
  const std::vector<Vector3d> points{{10, 80, 0}, {30, 90, 10}, {20, 70, -10}};
  const Vector3d centre(20, 80, 0);
  Eigen::AlignedBox3d angles;
  Eigen::AlignedBox3d translations;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    const Isometry3d motion = random_motion_in_box(seed, points, {0.2, 10.0});
    translations.extend(motion * centre - centre);
    const Eigen::Matrix3d& R = motion.linear();  // Rz Ry Rx
    angles.extend(
        Vector3d(std::atan2(R(2, 1), R(2, 2)), std::asin(-R(2, 0)), std::atan2(R(1, 0), R(0, 0))));
  }
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GE(translations.min()[axis], -10.0 - 1e-9);
    EXPECT_LE(translations.max()[axis], 10.0 + 1e-9);
    EXPECT_GT(translations.sizes()[axis], 19.8);
    EXPECT_GE(angles.min()[axis], -0.2 - 1e-9);
    EXPECT_LE(angles.max()[axis], 0.2 + 1e-9);
    EXPECT_GT(angles.sizes()[axis], 0.396);
  }
}

RC_GTEST_PROP(SpreadDisplacements, FillBinsEvenly, ()) {
  const int count = integer(1, 40);
  const int bins = integer(1, 6);
  const double low = uniform(0.0, 20.0);
  const double high = low + uniform(0.5, 30.0);
  const auto seed = static_cast<std::uint64_t>(integer(0, 1000));
  const std::vector<double> spread = spread_displacements_mm(seed, count, low, high, bins);
  RC_ASSERT(spread.size() == static_cast<std::size_t>(count));
  std::vector<int> counts(static_cast<std::size_t>(bins), 0);
  for (const double mm : spread) {
    RC_ASSERT(mm >= low);
    RC_ASSERT(mm <= high);
    ++counts[static_cast<std::size_t>(std::min(bins - 1.0, (mm - low) / (high - low) * bins))];
  }
  const auto [fewest, most] = std::minmax_element(counts.begin(), counts.end());
  RC_ASSERT(*most - *fewest <= 1);
  RC_ASSERT(spread == spread_displacements_mm(seed, count, low, high, bins));
}

// With eight starts in one bin, there is one in each eighth of it.
TEST(SpreadDisplacements, AreSpreadWithinABin) {
  std::set<int> eighths;
  for (const double mm : spread_displacements_mm(5, 8, 8.0, 16.0, 1))
    eighths.insert(static_cast<int>(mm));
  EXPECT_EQ(eighths.size(), 8U);
}

TEST(RandomMotion, RefusesWhatIsNoInput) {
  const std::vector<Vector3d> points = cube_corners(10.0);
  expect_input_error([] { random_motion(1, {}, 1.0, 0.1); }, {"targets", "at least 1"});
  expect_input_error([&] { random_motion(1, points, -1.0, 0.1); }, {"displacement_mm", "-1"});
  expect_input_error([&] { random_motion(1, points, 1.0, 4.0); }, {"max_rotation_rad", "4"});
  expect_input_error([&] { random_motion_in_box(1, points, {-0.1, 1.0}); }, {"rotation_rad"});
  expect_input_error([&] { random_motion_in_box(1, points, {0.1, -1.0}); }, {"translation_mm"});
  expect_input_error([] { spread_displacements_mm(1, 0, 0.0, 1.0, 1); }, {"count"});
  expect_input_error([] { spread_displacements_mm(1, 1, 0.0, 1.0, 0); }, {"bins"});
  expect_input_error([] { spread_displacements_mm(1, 1, 2.0, 1.0, 1); }, {"max_displacement_mm"});
}

}  // namespace
}  // namespace usct::test
