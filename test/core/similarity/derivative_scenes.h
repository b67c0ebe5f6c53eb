#pragma once

#include <gtest/gtest.h>

#include "core/similarity/patch_scenes.h"
#include "registration/evidence/decoys.h"
#include "us_ct_registration/similarity/similarity.h"

/// Scenes for the derivatives of similarities, and their comparison with slopes of the value.
namespace usct::test {

/// A smooth CT, and ultrasound that shows it from another pose, with noise.
struct Registrable {
  BeamUltrasound us = noisy_ultrasound(downward_beams(30, 28, 26));
  Volume<float> ct = smooth_ct();

  static Volume<float> smooth_ct() {
    Volume<float> ct(oblique_grid({48, 48, 48}, {1.0, 1.1, 0.9}));
    for (int k = 0; k < 48; ++k)
      for (int j = 0; j < 48; ++j)
        for (int i = 0; i < 48; ++i)
          ct.at(i, j, k) = static_cast<float>(100.0 + 70.0 * (std::sin(0.25 * i + 0.1 * k) +
                                                              std::sin(0.2 * j - 0.15 * i) +
                                                              std::sin(0.22 * k + 0.1 * j)));
    return ct;
  }

  Registrable() {
    for (int f = 0; f < us.beams.frames; ++f)
      for (int l = 0; l < us.beams.lines; ++l)
        for (int s = 0; s < us.beams.samples(); ++s) {
          const Seen seen =
              seen_at(us, s, l, f, ct, Eigen::Isometry3d::Identity(), GradientChannel::kMagnitude);
          us.brightness[offset_of(us.beams, s, l, f)] +=
              static_cast<float>(seen.ct_hu + seen.gradient);
        }
  }
};

/// The pose after a small motion of the ultrasound, in the order of SimilarityDerivatives.
inline SimilarityPose changed(const SimilarityPose& pose,
                              const SimilarityDerivatives::Vector& change) {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  const Eigen::Vector3d turn = change.head<3>();
  if (turn.norm() > 0.0)
    motion.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  motion.translation() = change.segment<3>(3);
  return {pose.T_ct_us * motion,
          {pose.errors.depth + change[6], pose.errors.sweep + change[7],
           pose.errors.unevenness + change[8]}};
}

/// Changes that move the field by about a millimetre.
inline SimilarityDerivatives::Vector unit_changes() {
  SimilarityDerivatives::Vector units;
  units << 0.1, 0.1, 0.1, 1.0, 1.0, 1.0, 0.05, 0.1, 0.1;
  return units;
}

/// Compares the first entries of the gradient with differences of the value over steps of a voxel's
/// size, since the value has a small step wherever a sample goes from cell to cell. The tolerance
/// is for what a rotation does within a patch.
inline void expect_slopes(const Similarity& similarity, const SimilarityPose& pose,
                          int count = SimilarityDerivatives::kMotion) {
  const auto derivatives = similarity.derivatives(pose, DerivativeOrder::kCurvature);
  ASSERT_TRUE(derivatives);
  EXPECT_EQ(derivatives->value.value, similarity.evaluate(pose).value);
  const SimilarityDerivatives::Vector units = unit_changes();
  const SimilarityDerivatives::Vector gradient = derivatives->gradient.cwiseProduct(units);
  for (int i = 0; i < count; ++i) {
    constexpr double kStep = 0.4;
    SimilarityDerivatives::Vector step = SimilarityDerivatives::Vector::Zero();
    step[i] = kStep * units[i];
    const double slope = (similarity.evaluate(changed(pose, step)).value -
                          similarity.evaluate(changed(pose, -step)).value) /
                         (2.0 * kStep);
    EXPECT_NEAR(gradient[i], slope, 0.2 * gradient.norm()) << i;
  }
  const auto alone = similarity.derivatives(pose, DerivativeOrder::kGradient);
  EXPECT_EQ(alone->gradient, derivatives->gradient);
  EXPECT_TRUE(alone->curvature.isZero(0.0));
}

inline SimilarityPose near_pose(const AcquisitionErrors& errors) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(0.05, Eigen::Vector3d(1, -2, 1).normalized()).toRotationMatrix();
  T.translation() = Eigen::Vector3d(0.8, -0.7, 0.9);
  return {T, errors};
}

/// The same of the mirrored ultrasound, where that lies near the pose.
inline void expect_slopes_of_mirrored(const Similarity& similarity) {
  Eigen::Isometry3d mirror = Eigen::Isometry3d::Identity();
  mirror.linear() = Eigen::Vector3d(1.0, 1.0, -1.0).asDiagonal();
  mirror.translation() = Eigen::Vector3d(2.0, -1.0, 3.0);
  const registration::MirroredSimilarity mirrored(similarity, mirror);
  SimilarityPose pose = near_pose({});
  pose.T_ct_us = pose.T_ct_us * mirror.inverse();
  expect_slopes(mirrored, pose);
}

}  // namespace usct::test
