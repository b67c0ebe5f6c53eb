#include <gtest/gtest.h>

#include <cmath>

#include "core/evaluation/small_study.h"
#include "core/io/expect_input_error.h"
#include "evaluation/negative_cases.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/beam_grid.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

/// Ultrasound with a slope over depth, so bright that speckle of 60 dB is not clipped to 8 bits.
PreScanVolume sloped_ultrasound() {
  PreScanVolume us;
  us.geometry.axial = {120, 0.0, 0.5};
  us.geometry.array = CurvilinearArray{40.0, centred_table(64, 0.01)};
  us.geometry.motion = MotorSweep{27.25, centred_table(40, 0.012), 0.0};
  for (int beam = 0; beam < 64 * 40; ++beam)
    for (int s = 0; s < 120; ++s)
      us.voxels.push_back(static_cast<std::uint8_t>(160 - s / 4 + (beam * 7 + s * 13) % 21));
  return us;
}

double profile_at(const PreScanVolume& us, int sample) {
  double sum = 0.0;
  for (int f = 0; f < us.geometry.frames(); ++f)
    for (int l = 0; l < us.geometry.lines(); ++l) sum += us.at(sample, l, f);
  return sum / (us.geometry.frames() * us.geometry.lines());
}

/// Correlation of values minus their mean at each depth, between beams `step` lines apart.
double correlation(const PreScanVolume& a, const PreScanVolume& b, int sample_step, int line_step) {
  double ab = 0.0;
  double aa = 0.0;
  double bb = 0.0;
  for (int s = 0; s + sample_step < a.geometry.samples(); ++s) {
    const double mean_a = profile_at(a, s);
    const double mean_b = profile_at(b, s + sample_step);
    for (int f = 0; f < a.geometry.frames(); ++f)
      for (int l = 0; l + line_step < a.geometry.lines(); ++l) {
        const double x = a.at(s, l, f) - mean_a;
        const double y = b.at(s + sample_step, l + line_step, f) - mean_b;
        ab += x * y;
        aa += x * x;
        bb += y * y;
      }
  }
  return ab / std::sqrt(aa * bb);
}

TEST(Reversed, LinesOrFramesAreInReverseOrderAndTwiceIsTheOriginal) {
  const PreScanVolume us = small_case("a", 1).ultrasound;
  const PreScanVolume lines = lines_reversed(us);
  const PreScanVolume frames = frames_reversed(us);
  EXPECT_NE(lines.voxels, us.voxels);
  EXPECT_NE(frames.voxels, us.voxels);
  for (int f = 0; f < 6; ++f)
    for (int l = 0; l < 12; ++l)
      for (int s = 0; s < 24; ++s) {
        ASSERT_EQ(lines.at(s, l, f), us.at(s, 11 - l, f));
        ASSERT_EQ(frames.at(s, l, f), us.at(s, l, 5 - f));
      }
  EXPECT_EQ(lines_reversed(lines).voxels, us.voxels);
  EXPECT_EQ(frames_reversed(frames).voxels, us.voxels);
}

// A motorised probe is symmetric: turned by 180 degrees about y, its own axis, it records the same
// points in the reverse order of lines and frames.
TEST(HalfTurn, OfAMotorisedProbeIsAboutItsAxis) {
  const Isometry3d T = half_turn(small_case("a", 1).ultrasound.geometry);
  EXPECT_TRUE(T.isApprox(Isometry3d(Eigen::AngleAxisd(kPi, Vector3d::UnitY())), 1e-9));
}

TEST(HalfTurn, OfAParallelSweepIsAboutTheMiddleOfTheField) {
  ScanGeometry sweep;
  sweep.axial = {20, 1.0, 2.0};
  sweep.array = LinearArray{{-10.0, -5.0, 0.0, 5.0, 10.0}};
  TrackedSweep poses;
  Isometry3d T_us_probe = Isometry3d::Identity();
  T_us_probe.linear() = Eigen::AngleAxisd(0.8, Vector3d(1, 1, -2).normalized()).matrix();
  T_us_probe.translation() = Vector3d(300, -20, 50);
  for (int f = 0; f < 7; ++f)
    poses.T_us_frame.push_back(T_us_probe * Eigen::Translation3d(0, 0, 3.0 * f));
  sweep.motion = poses;
  const Isometry3d T = half_turn(sweep);
  const Isometry3d T_middle = T_us_probe * Eigen::Translation3d(0, 0, 9.0);
  EXPECT_TRUE(
      T.isApprox(T_middle * Eigen::AngleAxisd(kPi, Vector3d::UnitY()) * T_middle.inverse(), 1e-9));
}

/// A CT on an oblique grid with voxels that are all different.
CtVolume oblique_ct() {
  Grid grid;
  grid.size = {4, 5, 3};
  grid.spacing_mm = {1.0, 2.0, 5.0};
  grid.origin_mm = {30, -60, 800};
  grid.direction = Eigen::AngleAxisd(0.4, Vector3d(1, 2, 2).normalized()).matrix();
  CtVolume ct(grid);
  for (std::size_t i = 0; i < ct.voxels.size(); ++i) ct.voxels[i] = static_cast<std::int16_t>(i);
  return ct;
}

TEST(MirroredCt, HasLeftForRightAboutThePoint) {
  const CtVolume ct = oblique_ct();
  const Vector3d centre(33, -57, 806);
  const CtVolume mirror = mirrored_ct(ct, centre);
  mirror.validate("mirror");
  EXPECT_EQ(mirror.voxels, ct.voxels);
  for (const Vector3d& index : {Vector3d(0, 0, 0), Vector3d(3, 4, 2), Vector3d(1, 3, 0.5)}) {
    const Vector3d p = ct.grid.physical_from_index(index);
    EXPECT_LT((mirror.grid.physical_from_index(index) - Vector3d(66 - p.x(), p.y(), p.z())).norm(),
              1e-9);
  }
}

TEST(AxesSwappedCt, ExchangesTheSecondAndThirdAxisAboutThePoint) {
  const CtVolume ct = oblique_ct();
  // The point at index (2, 1, 1), of which steps along the axes are counted.
  const Vector3d centre = ct.grid.physical_from_index(Vector3d(2, 1, 1));
  const CtVolume swapped = axes_swapped_ct(ct, centre);
  swapped.validate("swapped");
  EXPECT_EQ(swapped.voxels, ct.voxels);
  const Eigen::Matrix3d& axes = ct.grid.direction;
  EXPECT_LT((swapped.grid.physical_from_index(Vector3d(2, 1, 1)) - centre).norm(), 1e-9);
  EXPECT_LT((swapped.grid.physical_from_index(Vector3d(3, 1, 1)) - centre - axes.col(0)).norm(),
            1e-9);
  EXPECT_LT(
      (swapped.grid.physical_from_index(Vector3d(2, 2, 1)) - centre - 2.0 * axes.col(2)).norm(),
      1e-9);
  EXPECT_LT(
      (swapped.grid.physical_from_index(Vector3d(2, 1, 2)) - centre - 5.0 * axes.col(1)).norm(),
      1e-9);
}

TEST(SpeckleOnly, HasTheDepthProfileButNothingElseOfTheOriginal) {
  const PreScanVolume us = sloped_ultrasound();
  const PreScanVolume noise = speckle_only(us, 7);
  for (int s = 0; s < 120; s += 9) EXPECT_NEAR(profile_at(noise, s), profile_at(us, s), 1.0) << s;
  EXPECT_LT(std::abs(correlation(us, noise, 0, 0)), 0.01);
  EXPECT_LT(std::abs(correlation(noise, speckle_only(us, 8), 0, 0)), 0.02);
  EXPECT_EQ(speckle_only(us, 7).voxels, noise.voxels);
}

// The standard deviation of the logarithm of a Rayleigh amplitude is pi / sqrt(24), 5.57 dB.
TEST(SpeckleOnly, IsLogCompressedRayleighAsLargeAsThePointSpread) {
  const PreScanVolume us = sloped_ultrasound();
  const PreScanVolume noise = speckle_only(us, 3, {0.5, 1.0, 0.0});
  double squares = 0.0;
  for (int s = 0; s < 120; ++s) {
    const double mean = profile_at(noise, s);
    for (int f = 0; f < 40; ++f)
      for (int l = 0; l < 64; ++l) squares += std::pow(noise.at(s, l, f) - mean, 2);
  }
  EXPECT_NEAR(std::sqrt(squares / (120 * 40 * 64)), 5.57 * 255.0 / 60.0, 0.7);
  // Samples 0.5 mm apart at sigma 0.5 mm: the field correlates by exp(-(d / 2 sigma)^2) = 0.78, the
  // logarithm of its amplitude by Li2(0.78^2) / Li2(1) = 0.44. At 2.5 mm there is no correlation.
  EXPECT_NEAR(correlation(noise, noise, 1, 0), 0.44, 0.05);
  EXPECT_LT(std::abs(correlation(noise, noise, 5, 0)), 0.03);
  // Lines lie 0.7 mm apart in the middle: Li2(exp(-0.245)) / Li2(1) = 0.60.
  EXPECT_NEAR(correlation(noise, noise, 0, 1), 0.60, 0.05);
  EXPECT_LT(std::abs(correlation(noise, noise, 0, 8)), 0.03);
}

TEST(PoseOfOtherCt, TurnsAsTheGivenOneAndPutsTheCentreInPlace) {
  const StudyCase own = small_case("a", 1);
  const Vector3d centre_us(3, 70, -2);
  const Vector3d centre_other(120, -40, 900);
  const Isometry3d T = pose_of_other_ct(own.T_us_ct_true, centre_us, centre_other);
  EXPECT_TRUE(T.linear().isApprox(own.T_us_ct_true.linear(), 1e-14));
  EXPECT_LT((T * centre_other - centre_us).norm(), 1e-9);
}

TEST(MovedApart, LeavesAGapInEveryDirection) {
  const StudyCase own = small_case("a", 2);
  std::vector<Vector3d> us_points;
  const BeamGrid beams = beam_grid(own.ultrasound.geometry);
  for (int f = 0; f < 6; ++f)
    for (int l = 0; l < 12; ++l)
      for (int s = 0; s < 24; ++s) us_points.push_back(beams.point(f, l, s));
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Isometry3d T =
        moved_apart(own.T_us_ct_true, own.ct.grid, own.ultrasound.geometry, 150.0, seed);
    EXPECT_TRUE(T.linear().isApprox(own.T_us_ct_true.linear(), 1e-14));
    double nearest_mm = 1e9;
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 5; ++j)
        for (int k = 0; k < 4; ++k)
          for (const Vector3d& p : us_points)
            nearest_mm = std::min(
                nearest_mm, (T * own.ct.grid.physical_from_index(Vector3d(i, j, k)) - p).norm());
    EXPECT_GE(nearest_mm, 150.0);
    EXPECT_LT(nearest_mm, 400.0);
  }
}

TEST(SpeckleOnly, RefusesAnInvalidSize) {
  expect_input_error(
      [] {
        speckle_only(small_case("a", 1).ultrasound, 1, {0.3, -1.0, 1.0});
      },
      {"lateral_mm", "-1"});
}

}  // namespace
}  // namespace usct::test
