#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <limits>

#include "core/io/expect_input_error.h"
#include "core/registration/random_points.h"
#include "us_ct_registration/registration/landmarks.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

RC_GTEST_PROP(Landmarks, RecoverAKnownTransform, ()) {
  const Isometry3d T_target_source = random_pose(400.0);
  const Points source = random_points();
  const LandmarkAlignment found = align_landmarks(moved(T_target_source, source), source);
  RC_ASSERT((found.T_target_source.matrix() - T_target_source.matrix()).norm() < 1e-8);
  RC_ASSERT(found.residual_mm < 1e-9);
  const LandmarkAlignment back = align_landmarks(source, moved(T_target_source, source));
  RC_ASSERT((back.T_target_source.matrix() - T_target_source.inverse().matrix()).norm() < 1e-8);
}

// Three points always lie in a plane, so the third axis must be chosen right-handed.
RC_GTEST_PROP(Landmarks, ThreeAreEnough, ()) {
  const Isometry3d T_target_source = random_pose(400.0);
  const Vector3d p = random_vector(200.0);
  const Vector3d along = uniform(5.0, 60.0) * random_direction();
  const Vector3d across = uniform(0.3, 1.0) * along.unitOrthogonal() * along.norm();
  const Points source = {p, p + along, p + across};
  const LandmarkAlignment found = align_landmarks(moved(T_target_source, source), source);
  RC_ASSERT((found.T_target_source.matrix() - T_target_source.matrix()).norm() < 1e-8);
}

// The result is the least-squares solution: no small motion away from it reduces the residual.
RC_GTEST_PROP(Landmarks, LeaveTheLeastResidual, ()) {
  const Points source = random_points();
  Points target = moved(random_pose(400.0), source);
  for (Vector3d& point : target) point += random_vector(5.0);
  const LandmarkAlignment found = align_landmarks(target, source);
  const auto residual_mm = [&](const Isometry3d& T) {
    double sum = 0.0;
    for (std::size_t i = 0; i < source.size(); ++i)
      sum += (target[i] - T * source[i]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(source.size()));
  };
  RC_ASSERT(std::abs(residual_mm(found.T_target_source) - found.residual_mm) < 1e-9);
  RC_ASSERT(std::abs(found.T_target_source.linear().determinant() - 1.0) < 1e-9);
  for (int i = 0; i < 10; ++i) {
    Isometry3d nudge(Eigen::AngleAxisd(uniform(0.0, 0.05), random_direction()));
    nudge.pretranslate(random_vector(0.5));
    const Vector3d pivot = found.T_target_source * source[0];
    nudge = Eigen::Translation3d(pivot) * nudge * Eigen::Translation3d(-pivot);
    RC_ASSERT(residual_mm(nudge * found.T_target_source) >= found.residual_mm - 1e-9);
  }
}

TEST(Landmarks, MirrorImagesStayMirrored) {
  // No rotation maps a corner onto its mirror image; a wrong sign would claim that one does.
  const Points source = {{0, 0, 0}, {10, 0, 0}, {0, 20, 0}, {0, 0, 30}};
  Points target = source;
  for (Vector3d& point : target) point.x() = -point.x();
  const LandmarkAlignment found = align_landmarks(target, source);
  EXPECT_NEAR(found.T_target_source.linear().determinant(), 1.0, 1e-12);
  EXPECT_GT(found.residual_mm, 1.0);
}

TEST(Landmarks, BadOnesAreNamed) {
  const Points good = {{0, 0, 0}, {10, 0, 0}, {0, 20, 0}};
  const auto expect_refused = [](const Points& target, const Points& source,
                                 const std::vector<std::string>& named) {
    expect_input_error([&] { align_landmarks(target, source); }, named);
  };
  expect_refused(good, {good[0], good[1]},
                 {"target landmarks: has 3 points", "as many as source landmarks, 2"});
  expect_refused({}, {}, {"0 points", "3"});
  expect_refused({good[0], good[1]}, {good[0], good[1]}, {"2 points", "3"});
  const Points line = {{0, 0, 0}, {10, 0, 0}, {40, 0.2, 0}};
  expect_refused(good, line, {"source", "line"});
  expect_refused(line, good, {"target", "line"});
  Points broken = good;
  broken[1].z() = std::numeric_limits<double>::infinity();
  expect_refused(good, broken, {"source", "point 1", "finite"});
}

}  // namespace
}  // namespace usct::test
