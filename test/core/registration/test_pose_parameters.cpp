#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>

#include "core/geometry/random_geometry.h"
#include "core/io/expect_input_error.h"
#include "core/registration/random_points.h"
#include "us_ct_registration/registration/pose_parameters.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

double rms_displacement_mm(const Isometry3d& T_a, const Isometry3d& T_b,
                           const std::vector<Vector3d>& points) {
  double sum = 0.0;
  for (const Vector3d& point : points) sum += (T_a * point - T_b * point).squaredNorm();
  return std::sqrt(sum / static_cast<double>(points.size()));
}

PoseVector random_parameters(double bound) {
  PoseVector parameters;
  for (Eigen::Index i = 0; i < 6; ++i) parameters[i] = uniform(-bound, bound);
  return parameters;
}

RC_GTEST_PROP(PoseParameters, ZeroIsTheInitialPose, ()) {
  const Isometry3d initial = random_pose(400.0);
  const PoseParameters pose(initial, random_points());
  RC_ASSERT(pose.T_us_ct(PoseVector::Zero()).isApprox(initial, 1e-14));
}

// The steps and tolerances of the optimizers rest on this scale.
RC_GTEST_PROP(PoseParameters, OneUnitMovesThePointsByAMillimetre, ()) {
  const Isometry3d initial = random_pose(400.0);
  const std::vector<Vector3d> points_us = random_points();
  const std::vector<Vector3d> points_ct = moved(initial.inverse(), points_us);
  const PoseParameters pose(initial, points_us);
  constexpr double kStep = 1e-4;
  for (int i = 0; i < 6; ++i) {
    const double displacement_mm =
        rms_displacement_mm(pose.T_us_ct(kStep * PoseVector::Unit(i)),
                            pose.T_us_ct(-kStep * PoseVector::Unit(i)), points_ct);
    RC_ASSERT(std::abs(displacement_mm / (2.0 * kStep) - 1.0) < 1e-6);
  }
  const PoseVector any = random_parameters(1.0).normalized();
  const double displacement_mm =
      rms_displacement_mm(pose.T_us_ct(kStep * any), pose.T_us_ct(-kStep * any), points_ct);
  RC_ASSERT(std::abs(displacement_mm / (2.0 * kStep) - 1.0) < 1e-6);
}

RC_GTEST_PROP(PoseParameters, MotionDerivativeIsThatOfFiniteDifferences, ()) {
  const PoseParameters pose(random_pose(400.0), random_points());
  PoseVector at = random_parameters(10.0);
  if (integer(0, 3) == 0) at.setZero();
  const Eigen::Matrix<double, 6, 6> derivative = pose.motion_derivative(at);
  constexpr double kStep = 1e-4;
  for (int i = 0; i < 6; ++i) {
    const Isometry3d motion = pose.T_us_ct(at + kStep * PoseVector::Unit(i)) *
                              pose.T_us_ct(at - kStep * PoseVector::Unit(i)).inverse();
    const Eigen::AngleAxisd turn(motion.linear());
    PoseVector expected;
    expected << turn.angle() * turn.axis(), motion.translation();
    expected /= 2.0 * kStep;
    RC_ASSERT((derivative.col(i) - expected).norm() < 1e-4 * (1.0 + expected.norm()));
  }
}

RC_GTEST_PROP(PoseParameters, RotationTurnsAboutTheCentreOfThePoints, ()) {
  const std::vector<Vector3d> points_us = random_points();
  Vector3d centre = Vector3d::Zero();
  for (const Vector3d& point : points_us) centre += point / static_cast<double>(points_us.size());
  const Isometry3d initial = random_pose(400.0);
  const PoseParameters pose(initial, points_us);
  RC_ASSERT((pose.centre_us_mm() - centre).norm() < 1e-9);
  PoseVector parameters = random_parameters(50.0);
  const Vector3d translation = parameters.tail<3>();
  const Isometry3d motion = pose.T_us_ct(parameters) * initial.inverse();
  RC_ASSERT((motion * centre - (centre + translation)).norm() < 1e-9);
}

RC_GTEST_PROP(PoseParameters, AMotionIsItsRotationVectorAndTranslation, ()) {
  const Isometry3d initial = random_pose(400.0);
  const PoseParameters pose(initial, random_points());
  const double angle_rad = uniform(0.0, 3.0);
  const Vector3d axis = random_direction();
  const Isometry3d T_us_ct =
      pose.T_us_ct(pose.parameters_of_motion(angle_rad * axis, random_vector(20.0)));
  const Eigen::Matrix3d expected =
      Eigen::AngleAxisd(angle_rad, axis).toRotationMatrix() * initial.linear();
  RC_ASSERT((T_us_ct.linear() - expected).norm() < 1e-9);
}

// Moving probe and CT together must not change the optimizer's problem, except for its axes.
RC_GTEST_PROP(PoseParameters, CommonMotionOfUltrasoundOnlyTurnsThem, ()) {
  const Isometry3d initial = random_pose(400.0);
  const Isometry3d common = random_pose(400.0);
  const std::vector<Vector3d> points_us = random_points();
  const PoseParameters here(initial, points_us);
  const PoseParameters there(common * initial, moved(common, points_us));
  const PoseVector parameters = random_parameters(40.0);
  PoseVector turned;
  turned << common.linear() * parameters.head<3>(), common.linear() * parameters.tail<3>();
  RC_ASSERT((there.T_us_ct(turned).matrix() - (common * here.T_us_ct(parameters)).matrix()).norm() <
            1e-7);
}

RC_GTEST_PROP(PoseParameters, MotionOfTheCtFrameChangesNothing, ()) {
  const Isometry3d initial = random_pose(400.0);
  const Isometry3d T_ct_other = random_pose(400.0);
  const std::vector<Vector3d> points_us = random_points();
  const PoseVector parameters = random_parameters(40.0);
  const Isometry3d a = PoseParameters(initial, points_us).T_us_ct(parameters) * T_ct_other;
  const Isometry3d b = PoseParameters(initial * T_ct_other, points_us).T_us_ct(parameters);
  RC_ASSERT((a.matrix() - b.matrix()).norm() < 1e-8);
}

TEST(PoseParameters, HalfATurnIsReached) {
  const PoseParameters pose(Isometry3d::Identity(), cube_corners(30.0));
  for (const Vector3d& axis : {Vector3d::UnitX().eval(), Vector3d::UnitY().eval(),
                               Vector3d(1.0, 2.0, -2.0).normalized()}) {
    const Isometry3d half_turn(Eigen::AngleAxisd(kPi, axis));
    const PoseVector parameters = pose.parameters_of_motion(kPi * axis, Vector3d::Zero());
    EXPECT_TRUE(pose.T_us_ct(parameters).isApprox(half_turn, 1e-7));
  }
}

TEST(PoseParameters, ScaleOfACubeIsKnown) {
  // Corners at +-30 mm: each is 30 sqrt(2) mm from each axis through the centre.
  const PoseParameters pose(Isometry3d::Identity(), cube_corners(30.0));
  PoseVector expected;
  expected << 0.3 * 30.0 * std::sqrt(2.0), 0.0, 0.0, 1.0, 2.0, 3.0;
  EXPECT_TRUE(pose.parameters_of_motion(Vector3d(0.3, 0.0, 0.0), Vector3d(1.0, 2.0, 3.0))
                  .isApprox(expected, 1e-12));
}

TEST(PoseParameters, BadInputIsNamed) {
  const auto expect_refused = [](const Isometry3d& initial, const std::vector<Vector3d>& points,
                                 const std::vector<std::string>& named) {
    expect_input_error([&] { PoseParameters(initial, points); }, named);
  };
  const Isometry3d identity = Isometry3d::Identity();
  const std::vector<Vector3d> corners = cube_corners(30.0);
  expect_refused(identity, {}, {"0 points"});
  expect_refused(identity, {{0, 0, 0}, {1, 0, 0}}, {"2 points", "3"});
  expect_refused(identity, {{0, 0, 0}, {1, 2, 3}, {2, 4, 6}, {-3, -6, -9}}, {"line"});
  expect_refused(identity, {{5, 5, 5}, {5, 5, 5}, {5, 5, 5}}, {"line"});
  std::vector<Vector3d> bad_points = corners;
  bad_points[3].y() = std::numeric_limits<double>::quiet_NaN();
  expect_refused(identity, bad_points, {"point 3", "finite"});
  Isometry3d bad = identity;
  bad.linear() *= 1.01;
  expect_refused(bad, corners, {"initial pose", "rotation"});
  bad = identity;
  bad.linear()(1, 1) = std::numeric_limits<double>::quiet_NaN();
  expect_refused(bad, corners, {"initial pose", "rotation"});
  bad = identity;
  bad.translation().z() = std::numeric_limits<double>::infinity();
  expect_refused(bad, corners, {"initial pose", "translation"});
}

TEST(MeanDisplacement, IsTheMeanOfDistances) {
  const Isometry3d identity = Isometry3d::Identity();
  Isometry3d shifted = identity;
  shifted.translation() = Vector3d(3.0, 4.0, 0.0);
  EXPECT_NEAR(mean_displacement_mm(identity, shifted, cube_corners(30.0)), 5.0, 1e-12);
  // Half a turn about z: points at distance r from the axis move by 2 r.
  const Isometry3d half_turn(Eigen::AngleAxisd(kPi, Vector3d::UnitZ()));
  EXPECT_NEAR(mean_displacement_mm(half_turn, identity, {{1, 0, 7}, {0, 5, -7}, {0, 0, 9}}), 4.0,
              1e-12);
  expect_input_error([&] { mean_displacement_mm(identity, shifted, {}); }, {"0 points"});
}

}  // namespace
}  // namespace usct::test
