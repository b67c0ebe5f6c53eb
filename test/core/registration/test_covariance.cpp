#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>

#include "core/registration/registration_cases.h"
#include "registration/confidence.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// What a motion of the US frame makes of small motions (w, t): with p' = R p + g,
/// p' + R (w x p + t) = p' + (R w) x p' + R t + g x (R w).
Matrix6d adjoint(const Isometry3d& motion) {
  const Vector3d g = motion.translation();
  Matrix3d cross;
  cross << 0.0, -g.z(), g.y(), g.z(), 0.0, -g.x(), -g.y(), g.x(), 0.0;
  Matrix6d result = Matrix6d::Zero();
  result.topLeftCorner<3, 3>() = motion.linear();
  result.bottomRightCorner<3, 3>() = motion.linear();
  result.bottomLeftCorner<3, 3>() = cross * motion.linear();
  return result;
}

/// Ratios of the standard deviations of `a` to those of `b`, least and greatest over all
/// directions.
std::pair<double, double> deviation_ratios(const Matrix6d& a, const Matrix6d& b) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix6d> eigen(a, b);
  return {std::sqrt(eigen.eigenvalues().minCoeff()), std::sqrt(eigen.eigenvalues().maxCoeff())};
}

RegistrationResult of(const RegistrationCase& images,
                      const RegistrationOptions& options = quick_options()) {
  const RegistrationResult result = registered(images, nearby(images), options);
  EXPECT_TRUE(result.T_us_ct) << result.message;
  EXPECT_TRUE(result.covariance);
  return result;
}

double expected_mm(const RegistrationResult& result) {
  return result.measures.at("expected_error_mm");
}

TEST(Covariance, IsSymmetricAndPositiveDefinite) {
  for (const RegistrationCase* images : {&agar_case(), &patient_case()}) {
    const Matrix6d covariance = *of(*images).covariance;
    EXPECT_EQ(covariance, covariance.transpose());
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>(covariance).eigenvalues().minCoeff(), 0.0);
  }
}

/// At a given pose, whatever the search would find: by the similarity of the last stage.
std::optional<Matrix6d> at_pose(const RegistrationCase& images, const Isometry3d& T_us_ct,
                                double spacing_mm) {
  RegistrationOptions options = quick_options();
  options.stages.back().spacing_mm = spacing_mm;
  options.stages.back().similarity.patches = options.stages[1].similarity.patches;
  const registration::PreparedUltrasound us = registration::prepare_ultrasound(images.us, options);
  const registration::CtInReach reach =
      registration::ct_in_reach(images.ct, us.us.beams, T_us_ct, options);
  const registration::Level level =
      registration::make_level(options.stages.back(), us, reach,
                               registration::ct_levels(reach, options).back(), false, options);
  registration::Search search(us.points_us_mm, options, {});
  return registration::pose_covariance(*level.similarity, {T_us_ct, {}}, options.confidence,
                                       search);
}

TEST(Covariance, DISABLED_FollowsTheUltrasoundFrame) {
  const std::optional<Matrix6d> here = at_pose(patient_case(), patient_case().T_us_ct_true, 2.0);
  ASSERT_TRUE(here);
  struct {
    Isometry3d motion;
    double tolerance;
  } const examples[] = {
      {rigid(Vector3d::Zero(), {150, -60, 90}), 1e-2},
      // Derivatives are then taken along other directions.
      {rigid({0.7, -0.4, 1.2}, {150, -60, 90}), 0.25},
  };
  for (const auto& example : examples) {
    const RegistrationCase other = moved(patient_case(), example.motion, Isometry3d::Identity());
    const std::optional<Matrix6d> there = at_pose(other, other.T_us_ct_true, 2.0);
    ASSERT_TRUE(there);
    const Matrix6d A = adjoint(example.motion);
    const auto [least, greatest] = deviation_ratios(*there, A * *here * A.transpose());
    EXPECT_GT(least, 1.0 - example.tolerance);
    EXPECT_LT(greatest, 1.0 + example.tolerance);
  }
}

TEST(Covariance, WidensAsTheOptionsSay) {
  const auto expected = [](double factor, double systematic) {
    RegistrationOptions options = quick_options();
    options.confidence.deviation_factor = factor;
    options.confidence.systematic_mm = systematic;
    options.confidence.max_expected_error_mm = 100.0;
    return expected_mm(of(agar_case(), options));
  };
  const double of_patches_mm = expected(1.0, 0.0);
  EXPECT_GT(of_patches_mm, 0.0);
  EXPECT_NEAR(expected(2.0, 0.0), 2.0 * of_patches_mm, 1e-9);
  EXPECT_NEAR(expected(1.0, 3.0), std::hypot(of_patches_mm, 3.0), 1e-6);
}

/// At the truth, without what no image shows.
double of_patches_mm(const RegistrationCase& images) {
  const std::optional<Matrix6d> covariance = at_pose(images, images.T_us_ct_true, 2.0);
  EXPECT_TRUE(covariance);
  if (!covariance) return 0.0;
  return expected_tre_mm(*covariance, images.targets_us_mm).rms_mm;
}

TEST(Covariance, DISABLED_GrowsWhereLessUltrasoundCounts) {
  RegistrationCase images = patient_case();
  const double all_mm = of_patches_mm(images);
  const int frames = images.us.beams.frames;
  const std::size_t frame_size = images.us.brightness.size() / static_cast<std::size_t>(frames);
  images.us.known.assign(images.us.brightness.size(), 1);
  for (int frame = 0; frame < frames; ++frame)
    if (frame < frames / 3 || frame >= 2 * frames / 3)
      std::fill_n(images.us.known.begin() +
                      static_cast<std::ptrdiff_t>(static_cast<std::size_t>(frame) * frame_size),
                  frame_size, 0);
  EXPECT_GT(of_patches_mm(images), 1.2 * all_mm);
}

TEST(Covariance, DISABLED_GrowsWithNoise) {
  RegistrationCase images = patient_case();
  const double clean_mm = of_patches_mm(images);
  std::mt19937 random(4);
  std::normal_distribution<float> noise(0.0F, 60.0F);
  for (float& value : images.us.brightness) value = std::clamp(value + noise(random), 0.0F, 254.0F);
  EXPECT_GT(of_patches_mm(images), 1.2 * clean_mm);
}

}  // namespace
}  // namespace usct::test
