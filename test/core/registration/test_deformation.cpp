#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <vector>

#include "core/geometry/random_geometry.h"
#include "registration/evidence/deformation.h"

namespace usct::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using registration::deformation_mm;
using registration::PeakFinder;
using registration::rigid_motion;
using registration::TissueRegion;
using registration::Wish;

constexpr double kLatticeMm = 3.0;

std::vector<Vector3d> lattice() {
  std::vector<Vector3d> moves;
  for (const int x : {-1, 0, 1})
    for (const int y : {-1, 0, 1})
      for (const int z : {-1, 0, 1}) moves.push_back(kLatticeMm * Vector3d(x, y, z));
  return moves;
}

/// The peak that is found from the values of a function at the translations of the lattice.
template <class Function>
Vector3d peak_of(const Function& function) {
  std::vector<double> values;
  for (const Vector3d& move : lattice()) values.push_back(function(move));
  return PeakFinder(lattice()).peak_mm(values);
}

Matrix3d random_matrix() {
  Matrix3d matrix;
  for (int i = 0; i < 9; ++i) matrix(i) = uniform(-1.0, 1.0);
  return matrix;
}

RC_GTEST_PROP(PeakFinder, FindsThePeakOfAnyQuadraticFunctionWithinReach, ()) {
  const Vector3d peak(uniform(-4.0, 4.0), uniform(-4.0, 4.0), uniform(-4.0, 4.0));
  const Matrix3d root = random_matrix();
  const Matrix3d curvature = root * root.transpose() + 0.1 * Matrix3d::Identity();
  const double height = uniform(-10.0, 10.0);
  const Vector3d found =
      peak_of([&](const Vector3d& p) { return height - (p - peak).dot(curvature * (p - peak)); });
  RC_ASSERT((found - peak).norm() < 1e-9);
}

TEST(PeakFinder, TakesTheBestTranslationIfThereIsNoPeakWithinReach) {
  const Vector3d corner = kLatticeMm * Vector3d(1.0, -1.0, 1.0);
  const Vector3d far = 10.0 * corner;
  EXPECT_EQ(peak_of([&](const Vector3d& p) { return -(p - far).squaredNorm(); }), corner);
  // This function rises to both sides along x, and is highest where x is greatest.
  EXPECT_EQ(peak_of([](const Vector3d& p) {
              return p.x() * p.x() + 0.1 * p.x() - p.y() * p.y() - p.z() * p.z();
            }),
            Vector3d(kLatticeMm, 0.0, 0.0));
}

const TissueRegion kAll{Vector3d(5.0, 70.0, -3.0), 1000.0, Vector3d(0.6, 0.0, 0.8)};

std::vector<Vector3d> random_places() {
  std::vector<Vector3d> places;
  for (int i = 0; i < 30; ++i)
    places.push_back(kAll.centre_us_mm +
                     Vector3d(uniform(-40, 40), uniform(-40, 40), uniform(-40, 40)));
  return places;
}

/// The wishes of tissue that has moved as a whole.
std::vector<Wish> moved_by(const Eigen::Isometry3d& motion, const std::vector<Vector3d>& places) {
  std::vector<Wish> wishes;
  for (const Vector3d& place : places)
    wishes.push_back({place, motion * place - place, uniform(0.1, 1.0)});
  return wishes;
}

Eigen::Isometry3d small_motion(const Vector3d& about_mm) {
  const Vector3d axis = Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(0.1, 1)).normalized();
  const Vector3d shift_mm(uniform(-4, 4), uniform(-4, 4), uniform(-4, 4));
  return Eigen::Translation3d(about_mm + shift_mm) * Eigen::AngleAxisd(uniform(-0.05, 0.05), axis) *
         Eigen::Translation3d(-about_mm);
}

/// To first order in the angle: 0.05 rad at up to 70 mm leave 0.05^2 / 2 * 70 mm.
RC_GTEST_PROP(RigidMotion, IsThatOfTissueThatHasMovedAsAWhole, ()) {
  const std::vector<Vector3d> places = random_places();
  const Eigen::Isometry3d motion = small_motion(kAll.centre_us_mm);
  const Eigen::Isometry3d found = rigid_motion(moved_by(motion, places));
  for (const Vector3d& place : places) RC_ASSERT((found * place - motion * place).norm() < 0.1);
}

/// Wishes that have nothing to do with each other do not add up.
RC_GTEST_PROP(RigidMotion, IsNoneWherePlacesWishOppositeMotions, ()) {
  std::vector<Wish> wishes;
  for (const Vector3d& place : random_places())
    for (const double sign : {-1.0, 1.0})
      wishes.push_back({place, sign * Vector3d(3.0, -2.0, 1.0), 1.0});
  RC_ASSERT(rigid_motion(wishes).isApprox(Eigen::Isometry3d::Identity(), 1e-9));
}

TEST(RigidMotion, OfOnePlaceIsAShiftAndOfNoneIsNone) {
  const Vector3d place(5.0, 70.0, -3.0);
  const Vector3d shift(3.0, -2.0, 1.0);
  const Eigen::Isometry3d found = rigid_motion({{place, shift, 0.5}});
  EXPECT_TRUE(found.linear().isIdentity(1e-12));
  EXPECT_LT((found.translation() - shift).norm(), 1e-9);
  EXPECT_TRUE(rigid_motion({}).isApprox(Eigen::Isometry3d::Identity(), 0.0));
  EXPECT_TRUE(rigid_motion({{place, shift, 0.0}}).isApprox(Eigen::Isometry3d::Identity(), 0.0));
}

/// The cubes of a short sweep lie in one layer across its frames. A stretch of that, a shift and a
/// turn then differ by little, and noise must not pass for a stretch of any size.
TEST(Deformation, OfAShortSweepIsThatOfItsMotions) {
  for (const double tilt_rad : {0.0, 0.002, 0.01, 0.1}) {
    TissueRegion region = kAll;
    region.sweep_axis_us = Vector3d(std::sin(tilt_rad), 0.0, std::cos(tilt_rad));
    std::vector<Wish> wishes;
    double squares = 0.0;
    for (const int x : {-1, 0, 1})
      for (const int y : {-1, 0, 1}) {
        const Vector3d motion_mm(0.5 * std::sin(5 * x + y), 0.4 * std::cos(3 * y), 0.5 * x * y);
        wishes.push_back({region.centre_us_mm + 16.0 * Vector3d(x, y, 0.0), motion_mm, 1.0});
        squares += motion_mm.squaredNorm();
      }
    EXPECT_LT(deformation_mm(wishes, region), 1.5 * std::sqrt(squares / 9.0) + 0.1) << tilt_rad;
  }
}

/// A wrong step of the motor must neither count as a motion of tissue nor hide one. The tissue here
/// moves and turns as a whole, and the stretch is added to that.
RC_GTEST_PROP(Deformation, DoesNotCountAStretchAcrossTheFrames, ()) {
  const double stretch = uniform(-0.2, 0.2);
  const Vector3d turn = uniform(0.0, 0.1) * random_rotation().col(0);
  const Vector3d shift = uniform(0.0, 3.0) * random_rotation().col(0);
  std::vector<Wish> wishes;
  double squares = 0.0;
  double weights = 0.0;
  for (const Vector3d& place : random_places()) {
    const Vector3d offset = place - kAll.centre_us_mm;
    const Vector3d moved = shift + turn.cross(offset);
    const double weight = uniform(0.1, 2.0);
    const Vector3d stretched = stretch * offset.dot(kAll.sweep_axis_us) * kAll.sweep_axis_us;
    wishes.push_back({place, moved + stretched, weight});
    squares += weight * moved.squaredNorm();
    weights += weight;
  }
  RC_ASSERT(std::abs(deformation_mm(wishes, kAll) - std::sqrt(squares / weights)) < 1e-6);
}

/// Weights 3 and 1, motions of 1 and 3 mm: the root of (3 * 1 + 1 * 9) / 4. The third is too far
/// from the centre.
TEST(Deformation, IsTheWeightedRootMeanSquareNearTheCentre) {
  const TissueRegion near{Vector3d::Zero(), 20.0, Vector3d::UnitZ()};
  const std::vector<Wish> wishes = {
      {{10, 0, 0}, {1, 0, 0}, 3.0}, {{0, 10, 0}, {0, 3, 0}, 1.0}, {{0, 30, 0}, {0, 9, 0}, 5.0}};
  EXPECT_NEAR(deformation_mm(wishes, near), std::sqrt(3.0), 1e-12);
}

TEST(Deformation, IsNothingWhereNothingDepends) {
  EXPECT_EQ(deformation_mm({}, kAll), 0.0);
  EXPECT_EQ(deformation_mm({{kAll.centre_us_mm, {1, 2, 3}, 0.0}}, kAll), 0.0);
}

}  // namespace
}  // namespace usct::test
