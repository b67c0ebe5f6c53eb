#include <gtest/gtest.h>

#include "core/similarity/patch_scenes.h"
#include "registration/evidence/parts.h"
#include "us_ct_registration/registration/registration.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using registration::FieldPoints;
using registration::HalfPoses;

BeamGrid beams() { return downward_beams(24, 32, 28); }

Volume<float> ct() { return wavy_ct(oblique_grid({64, 60, 56}, {1.1, 1.0, 0.9})); }

Isometry3d small_motion(const Vector3d& shift_mm, double turn_rad) {
  return Isometry3d(Eigen::Translation3d(shift_mm) *
                    Eigen::AngleAxisd(turn_rad, Vector3d(1, 2, -1).normalized()));
}
const Isometry3d kOne = small_motion({1.2, -0.8, 0.9}, 0.03);
const Isometry3d kOther = small_motion({-1.0, 0.7, -1.1}, -0.02);

/// Ultrasound that shows the CT at a pose of each sample's own.
template <typename PoseOf>
BeamUltrasound seen(const PoseOf& T_us_ct_of) {
  BeamUltrasound us{beams(), {}, {}};
  const Volume<float> image = ct();
  for (int f = 0; f < us.beams.frames; ++f)
    for (int l = 0; l < us.beams.lines; ++l)
      for (int s = 0; s < us.beams.samples(); ++s) {
        const Vector3d p_ct = T_us_ct_of(f, l).inverse() * us.beams.point(f, l, s);
        us.brightness.push_back(
            static_cast<float>(sample_at_index(image, image.grid.index_from_physical(p_ct),
                                               Interpolation::kTrilinear, Outside::edge())));
      }
  return us;
}

FieldPoints field() {
  std::vector<Vector3d> points;
  const BeamGrid grid = beams();
  for (int f = 1; f < grid.frames; f += 5)
    for (int l = 1; l < grid.lines; l += 5)
      for (int s = 1; s < grid.samples(); s += 5) points.push_back(grid.point(f, l, s));
  return FieldPoints(points);
}

PartOptions climbing_by(OptimizerMethod method) {
  PartOptions options;
  options.optimizer.method = method;
  options.optimizer.max_evaluations = 500;
  options.optimizer.initial_step = 1.0;
  options.optimizer.step_tolerance = 0.01;
  options.reach_mm = 10.0;
  return options;
}

/// The poses of the halves, from the identity, which lies between the poses of the images.
std::optional<HalfPoses> halves_of(const BeamUltrasound& us,
                                   OptimizerMethod method = OptimizerMethod::kBobyqa) {
  const SimilarityImages images(std::make_shared<const BeamUltrasound>(us),
                                pack_ct(ct(), kWindow, kBackgroundHu), nullptr);
  LocalLc2Options similarity;
  similarity.patches = cubes(7.0);
  const RegistrationHooks hooks;
  registration::Run run(hooks);
  return registration::poses_of_halves(images, {similarity}, climbing_by(method),
                                       Isometry3d::Identity(), field(), run)
      .front();
}

constexpr double kFoundMm = 0.1;

TEST(Parts, HalvesOfARigidImageFindItsPose) {
  const std::optional<HalfPoses> halves = halves_of(seen([](int, int) { return kOne; }));
  ASSERT_TRUE(halves);
  for (const Isometry3d& T_us_ct : halves->all())
    EXPECT_LT(field().distance_mm(T_us_ct, kOne), kFoundMm);
}

TEST(Parts, HalvesOfLinesThatMovedApartFindTheirOwnPoses) {
  const std::optional<HalfPoses> halves =
      halves_of(seen([](int, int line) { return line < 16 ? kOne : kOther; }));
  ASSERT_TRUE(halves);
  EXPECT_LT(field().distance_mm(halves->left, kOne), kFoundMm);
  EXPECT_LT(field().distance_mm(halves->right, kOther), kFoundMm);
}

TEST(Parts, HalvesOfFramesThatMovedApartFindTheirOwnPoses) {
  const std::optional<HalfPoses> halves =
      halves_of(seen([](int frame, int) { return frame < 14 ? kOne : kOther; }));
  ASSERT_TRUE(halves);
  EXPECT_LT(field().distance_mm(halves->first, kOne), kFoundMm);
  EXPECT_LT(field().distance_mm(halves->last, kOther), kFoundMm);
}

/// A probe that goes there and back: its first and its last half in time would show the same
/// tissue.
TEST(Parts, HalvesOfASweepThatComesBackShareNoTissue) {
  const BeamUltrasound once = seen([](int frame, int) { return frame < 14 ? kOne : kOther; });
  BeamUltrasound us = once;
  const int frames = us.beams.frames;
  for (int f = 0; f < frames; ++f) {
    const int from = 2 * f < frames ? 2 * f : 2 * (frames - f) - 1;
    std::copy_n(once.beams.beams.begin() + from * us.beams.lines, us.beams.lines,
                us.beams.beams.begin() + f * us.beams.lines);
    const auto size = static_cast<std::ptrdiff_t>(us.beams.lines) * us.beams.samples();
    std::copy_n(once.brightness.begin() + from * size, size, us.brightness.begin() + f * size);
  }
  const std::optional<HalfPoses> halves = halves_of(us);
  ASSERT_TRUE(halves);
  EXPECT_LT(field().distance_mm(halves->first, kOne), kFoundMm);
  EXPECT_LT(field().distance_mm(halves->last, kOther), kFoundMm);
}

/// Eight lines are unknown, so that the other 24 are halved.
TEST(Parts, HalvesHaveAsManyKnownSamples) {
  BeamUltrasound us = seen([](int, int line) { return line < 20 ? kOne : kOther; });
  us.known.assign(us.brightness.size(), 1);
  for (int f = 0; f < us.beams.frames; ++f)
    for (int l = 0; l < 8; ++l)
      for (int s = 0; s < us.beams.samples(); ++s) us.known[offset_of(us.beams, s, l, f)] = 0;
  const std::optional<HalfPoses> halves = halves_of(us);
  ASSERT_TRUE(halves);
  EXPECT_LT(field().distance_mm(halves->left, kOne), kFoundMm);
  EXPECT_LT(field().distance_mm(halves->right, kOther), kFoundMm);
}

TEST(Parts, GaussNewtonFindsThePosesOfHalves) {
  const BeamUltrasound us = seen([](int, int line) { return line < 16 ? kOne : kOther; });
  const std::optional<HalfPoses> halves = halves_of(us, OptimizerMethod::kGaussNewton);
  ASSERT_TRUE(halves);
  EXPECT_LT(field().distance_mm(halves->left, kOne), kFoundMm);
  EXPECT_LT(field().distance_mm(halves->right, kOther), kFoundMm);
}

/// Each similarity has its own poses, whatever the order.
TEST(Parts, EachSimilarityClimbsForItself) {
  const SimilarityImages images(
      std::make_shared<const BeamUltrasound>(seen([](int, int) { return kOne; })),
      pack_ct(ct(), kWindow, kBackgroundHu), nullptr);
  LocalLc2Options fine;
  fine.patches = cubes(7.0);
  // A ridge that outweighs everything leaves nothing to climb.
  LocalLc2Options flat = fine;
  flat.ridge_intensity_hu = flat.ridge_gradient_hu_per_mm = 1e9;
  const PartOptions options = climbing_by(OptimizerMethod::kBobyqa);
  const RegistrationHooks hooks;
  registration::Run run(hooks);
  for (const bool fine_first : {true, false}) {
    const std::vector<SimilarityOptions> both = fine_first
                                                    ? std::vector<SimilarityOptions>{fine, flat}
                                                    : std::vector<SimilarityOptions>{flat, fine};
    const auto poses =
        registration::poses_of_halves(images, both, options, Isometry3d::Identity(), field(), run);
    ASSERT_EQ(poses.size(), 2U);
    const auto& of_fine = poses[fine_first ? 0 : 1];
    ASSERT_TRUE(of_fine);
    for (const Isometry3d& T_us_ct : of_fine->all())
      EXPECT_LT(field().distance_mm(T_us_ct, kOne), kFoundMm);
    const auto& of_flat = poses[fine_first ? 1 : 0];
    EXPECT_TRUE(!of_flat || field().distance_mm(of_flat->left, kOne) > kFoundMm);
  }
}

TEST(Parts, AHalfWithoutStructureSaysNothing) {
  BeamUltrasound us = seen([](int, int) { return kOne; });
  for (int f = 0; f < us.beams.frames; ++f)
    for (int l = 0; l < 16; ++l)
      for (int s = 0; s < us.beams.samples(); ++s)
        us.brightness[offset_of(us.beams, s, l, f)] = 80.0F;
  EXPECT_FALSE(halves_of(us));
}

}  // namespace
}  // namespace usct::test
