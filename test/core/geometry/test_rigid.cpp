#include <gtest/gtest.h>

#include <limits>

#include "core/io/expect_input_error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct::test {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

TEST(RotationVector, TurnsAboutItselfByItsLengthAndIsFoundAgain) {
  const double quarter_rad = 90.0 * kDegree;
  const Eigen::Matrix3d turn = rotation_from_vector({0.0, 0.0, quarter_rad});
  EXPECT_LT((turn * Vector3d(1, 0, 0) - Vector3d(0, 1, 0)).norm(), 1e-15);
  EXPECT_EQ(rotation_from_vector(Vector3d::Zero()), Eigen::Matrix3d::Identity());
  EXPECT_EQ(rotation_vector_of(Eigen::Matrix3d::Identity()), Vector3d::Zero());
  for (const Vector3d& w :
       {Vector3d(1e-6, -2e-6, 0.0), Vector3d(0.3, -0.2, 1.1), Vector3d(-1.5, 1.6, 2.1)})
    EXPECT_LT((rotation_vector_of(rotation_from_vector(w)) - w).norm(), 1e-12);
}

/// A quaternion that nobody set is all zero; made a rotation, it would draw a CT somewhere.
TEST(RigidFromQuaternion, NeedsALengthOfOne) {
  const Vector3d here(1.0, 2.0, 3.0);
  for (const double length : {0.0, 0.5, 1.01, std::numeric_limits<double>::quiet_NaN()})
    expect_input_error([&] { rigid_from_quaternion(Quaterniond(length, 0, 0, 0), here, "pose"); },
                       {"pose", "quaternion", "must be 1"});
  // Rounded numbers give a rotation all the same: half a turn about z here.
  const Eigen::Isometry3d T = rigid_from_quaternion(Quaterniond(0, 0, 0, 1.0005), here, "pose");
  EXPECT_TRUE((T * Vector3d(1, 0, 0)).isApprox(Vector3d(0, 2, 3), 1e-12));
}

/// A mirror image of the patient would look much like the patient.
TEST(RequireRotation, AReflectionIsNone) {
  Eigen::Matrix3d mirror = Eigen::Matrix3d::Identity();
  mirror(0, 0) = -1.0;
  expect_input_error([&] { require_rotation(mirror, "pose.tfm", "matrix"); },
                     {"pose.tfm", "'matrix'", "determinant -1"});
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = mirror;
  expect_input_error([&] { require_rigid(T, "pose"); }, {"pose", "rotation"});
}

}  // namespace
}  // namespace usct::test
