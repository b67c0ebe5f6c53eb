#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>

#include "core/registration/registration_cases.h"
#include "registration/pose_accuracy.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using registration::PoseAccuracy;

RegistrationResult of(const RegistrationCase& images,
                      const RegistrationOptions& options = quick_options()) {
  const RegistrationResult result = registered(images, nearby(images), options);
  EXPECT_TRUE(result.T_us_ct) << result.message;
  EXPECT_TRUE(result.covariance);
  return result;
}

TEST(Covariance, IsSymmetricAndPositiveDefinite) {
  for (const RegistrationCase* images : {&agar_case(), &patient_case()}) {
    const Matrix6d covariance = *of(*images).covariance;
    EXPECT_EQ(covariance, covariance.transpose());
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>(covariance).eigenvalues().minCoeff(), 0.0);
  }
}

registration::ImagePyramid prepared(const RegistrationCase& images, const Isometry3d& T_us_ct,
                                    const RegistrationOptions& options) {
  const RegistrationHooks hooks;
  registration::Run run(hooks);
  auto pyramid = registration::prepare(images.us, images.ct, T_us_ct, options, run);
  if (!pyramid) throw std::logic_error(pyramid.refusal().message);
  return *pyramid;
}

/// The accuracy at a given pose, without a search.
PoseAccuracy at_pose(const RegistrationCase& images, const Isometry3d& T_us_ct,
                     const RegistrationOptions& options = quick_options()) {
  const registration::ImagePyramid pyramid = prepared(images, T_us_ct, options);
  const RegistrationHooks hooks;
  const registration::Run run(hooks);
  const std::optional<PoseAccuracy> accuracy = registration::pose_accuracy(
      *pyramid.scatter_similarity, {T_us_ct, {}}, options.confidence, pyramid.prepared.field, run);
  EXPECT_TRUE(accuracy);
  return accuracy.value_or(PoseAccuracy{});
}

TEST(Covariance, WidensAsTheOptionsSay) {
  const auto expected_mm = [](double factor, double systematic) {
    RegistrationOptions options = quick_options();
    options.confidence.deviation_factor = factor;
    options.confidence.systematic_mm = systematic;
    const PoseAccuracy accuracy = at_pose(agar_case(), agar_case().T_us_ct_true, options);
    const registration::PreparedUltrasound us =
        registration::prepare_ultrasound(agar_case().us, options);
    return expected_tre_mm(accuracy.covariance, us.field.us_mm()).rms_mm;
  };
  const double scatter_mm = at_pose(agar_case(), agar_case().T_us_ct_true).scatter_mm;
  EXPECT_GT(scatter_mm, 0.0);
  EXPECT_NEAR(expected_mm(1.0, 0.0), scatter_mm, 1e-6);
  EXPECT_NEAR(expected_mm(2.0, 0.0), 2.0 * scatter_mm, 1e-6);
  EXPECT_NEAR(expected_mm(1.0, 3.0), std::hypot(scatter_mm, 3.0), 1e-6);
}

/// Effect of a motion of the US frame on small motions (w, t): with p' = R p + g, p' + R (w x p +
/// t) = p' + (R w) x p' + R t + g x (R w).
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

/// Covariance of the patches alone: the systematic error is the same in all directions.
TEST(Covariance, FollowsTheUltrasoundFrame) {
  RegistrationOptions options = quick_options();
  options.confidence.systematic_mm = 0.0;
  struct {
    Isometry3d motion;
    double factor;  // bound of the ratio in any direction
    double scatter_factor;
  } const examples[] = {
      {rigid(Vector3d::Zero(), {150, -60, 90}), 1.01, 1.01},
      // The similarity is no quadratic, and these motions sample it in other directions.
      {rigid({0.7, -0.4, 1.2}, {150, -60, 90}), 1.7, 1.25},
      {rigid({-1.9, 0.3, 0.5}, {-20, 40, 310}), 1.7, 1.25},
  };
  for (const RegistrationCase* images : {&agar_case(), &patient_case()}) {
    const PoseAccuracy here = at_pose(*images, images->T_us_ct_true, options);
    for (const auto& example : examples) {
      const RegistrationCase other = moved(*images, example.motion, Isometry3d::Identity());
      const PoseAccuracy there = at_pose(other, other.T_us_ct_true, options);
      const Matrix6d A = adjoint(example.motion);
      const auto [least, greatest] =
          deviation_ratios(there.covariance, A * here.covariance * A.transpose());
      EXPECT_GT(least, 1.0 / example.factor);
      EXPECT_LT(greatest, example.factor);
      EXPECT_GT(there.scatter_mm, here.scatter_mm / example.scatter_factor);
      EXPECT_LT(there.scatter_mm, here.scatter_mm * example.scatter_factor);
    }
  }
}

TEST(Scatter, GrowsWhereLessUltrasoundCounts) {
  RegistrationCase images = patient_case();
  const double all_mm = at_pose(images, images.T_us_ct_true).scatter_mm;
  const int frames = images.us.beams.frames;
  const std::size_t frame_size = images.us.brightness.size() / static_cast<std::size_t>(frames);
  images.us.known.assign(images.us.brightness.size(), 1);
  for (int frame = 0; frame < frames; ++frame)
    if (frame < frames / 3 || frame >= 2 * frames / 3)
      std::fill_n(images.us.known.begin() +
                      static_cast<std::ptrdiff_t>(static_cast<std::size_t>(frame) * frame_size),
                  frame_size, 0);
  EXPECT_GT(at_pose(images, images.T_us_ct_true).scatter_mm, 1.2 * all_mm);
}

TEST(Scatter, GrowsWithNoise) {
  RegistrationCase images = patient_case();
  const double clean_mm = at_pose(images, images.T_us_ct_true).scatter_mm;
  std::mt19937 random(4);
  std::normal_distribution<float> noise(0.0F, 60.0F);
  for (float& value : images.us.brightness) value = std::clamp(value + noise(random), 0.0F, 254.0F);
  EXPECT_GT(at_pose(images, images.T_us_ct_true).scatter_mm, 1.2 * clean_mm);
}

TEST(Scatter, GrowsWhereThePoseIsWrong) {
  for (const RegistrationCase* images : {&agar_case(), &patient_case()}) {
    const double right_mm = at_pose(*images, images->T_us_ct_true).scatter_mm;
    for (const double sign : {1.0, -1.0})
      EXPECT_GT(at_pose(*images, nearby(*images, sign)).scatter_mm, 3.0 * right_mm);
  }
}

}  // namespace
}  // namespace usct::test
