#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/ultrasound/sample_index.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/phantom/phantom.h"
#include "us_ct_registration/ultrasound/conditioning.h"
#include "with_threads.h"

namespace usct::test {
namespace {

/// Beams of a small convex probe, 60 samples 1 mm apart.
BeamGrid convex_beams(int lines = 16, int frames = 9) {
  ScanGeometry geometry;
  geometry.axial = {60, 2.0, 1.0};
  geometry.array = CurvilinearArray{30.0, centred_table(lines, 0.04)};
  geometry.motion = MotorSweep{20.0, centred_table(frames, 0.04), 0.0};
  return beam_grid(geometry);
}

/// Grey 60-140 without structure; equal beams give equal speckle.
BeamUltrasound speckle(const BeamGrid& beams) {
  BeamUltrasound us{beams, {}, {}};
  std::uint32_t state = 7;
  for (std::size_t i = 0; i < beams.beams.size() * static_cast<std::size_t>(beams.samples()); ++i) {
    state = state * 1664525U + 1013904223U;
    us.brightness.push_back(60.0F + static_cast<float>((state >> 16) % 81));
  }
  return us;
}

/// Options with which every sample counts.
ConditioningOptions no_masks() {
  ConditioningOptions options;
  options.depth.automatic = false;
  options.no_contact_share = 0.0;
  options.shadow_share = 0.0;
  options.saturated_grey = 1e9;
  return options;
}

TEST(Conditioning, GainAndOffsetDoNotMatter) {
  const BeamUltrasound us = speckle(convex_beams());
  for (const auto normalisation : {Normalisation::kZScore, Normalisation::kFlatten})
    for (const float gain : {0.2F, 1.0F, 3.0F})
      for (const float offset : {-40.0F, 25.0F}) {
        BeamUltrasound changed = us;
        for (float& value : changed.brightness) value = gain * value + offset;
        ConditioningOptions options = no_masks();
        options.normalisation = normalisation;
        const ConditionedUltrasound a = condition(us, options);
        const ConditionedUltrasound b = condition(changed, options);
        for (std::size_t i = 0; i < a.samples.size(); ++i)
          ASSERT_NEAR(a.samples[i], b.samples[i], 1e-3) << gain << ' ' << offset;
        EXPECT_GT(*std::max_element(a.samples.begin(), a.samples.end()), 0.5F);
      }
}

TEST(Conditioning, ASlowlyVaryingGainIsTakenOut) {
  // The same speckle with a gain that rises threefold over depth.
  const BeamUltrasound us = speckle(convex_beams());
  BeamUltrasound changed = us;
  for (int f = 0; f < 9; ++f)
    for (int l = 0; l < 16; ++l)
      for (int s = 0; s < 60; ++s)
        changed.brightness[at(us.beams, s, l, f)] *= 1.0F + static_cast<float>(s) / 30.0F;
  const auto difference = [&](Normalisation normalisation) {
    ConditioningOptions options = no_masks();
    options.normalisation = normalisation;
    options.smoothing_mm = 0.0;
    const ConditionedUltrasound a = condition(us, options);
    const ConditionedUltrasound b = condition(changed, options);
    double squares = 0.0;
    double all = 0.0;
    for (std::size_t i = 0; i < a.samples.size(); ++i) {
      squares += std::pow(a.samples[i] - b.samples[i], 2.0);
      all += std::pow(a.samples[i], 2.0);
    }
    return squares / all;
  };
  EXPECT_LT(difference(Normalisation::kZScore), 0.06);
  EXPECT_GT(difference(Normalisation::kFlatten), 0.06);  // the deviation still grows with depth
}

/// With a local deviation d of samples of variance 1, x becomes x / sqrt(d^2 + least^2).
TEST(Conditioning, TheLeastDeviationAddsToTheLocalOneByTheirSquares) {
  const BeamUltrasound us = speckle(convex_beams());
  const auto samples = [&](Normalisation normalisation, double least_deviation) {
    ConditioningOptions options = no_masks();
    options.normalisation = normalisation;
    options.least_deviation = least_deviation;
    return condition(us, options).samples;
  };
  const auto unscaled = samples(Normalisation::kFlatten, 0.5);
  const auto by_deviation = samples(Normalisation::kZScore, 1e-4);
  const auto by_both = samples(Normalisation::kZScore, 0.5);
  int compared = 0;
  for (std::size_t i = 0; i < unscaled.size(); ++i) {
    if (std::abs(unscaled[i]) < 0.1F) continue;  // a quotient of roundings
    ++compared;
    const double deviation = unscaled[i] / by_deviation[i];
    ASSERT_NEAR(unscaled[i] / by_both[i], std::hypot(deviation, 0.5), 1e-3) << i;
  }
  EXPECT_GT(compared, 1000);
}

TEST(Conditioning, WindowsAreMillimetresAcrossLinesAndFramesAtEveryDepth) {
  // A bright spike, smoothed: its second moment in mm is sigma^2 in every direction, although lines
  // are 1.3 mm apart at one end and more than twice that at the other.
  const BeamGrid beams = convex_beams(41, 41);
  for (const int depth : {12, 45}) {
    BeamUltrasound us = speckle(beams);
    ConditioningOptions options = no_masks();
    options.normalisation = Normalisation::kNone;
    options.smoothing_mm = 3.0;
    const ConditionedUltrasound without = condition(us, options);
    us.brightness[at(us.beams, depth, 20, 20)] += 1e6F;
    const ConditionedUltrasound with = condition(us, options);
    const auto second_moment = [&](const auto& sample_at, int count) {
      double sum = 0.0;
      double moment = 0.0;
      for (int i = 0; i < count; ++i) {
        const auto [s, l, f] = sample_at(i);
        const std::size_t sample = at(us.beams, s, l, f);
        const double weight = with.samples[sample] - without.samples[sample];
        sum += weight;
        moment += weight * (beams.point(f, l, s) - beams.point(20, 20, depth)).squaredNorm();
      }
      return moment / sum;
    };
    using Index = std::array<int, 3>;
    EXPECT_NEAR(second_moment([](int i) { return Index{i, 20, 20}; }, 60), 9.0, 0.7) << depth;
    EXPECT_NEAR(second_moment([&](int i) { return Index{depth, i, 20}; }, 41), 9.0, 0.7) << depth;
    EXPECT_NEAR(second_moment([&](int i) { return Index{depth, 20, i}; }, 41), 9.0, 0.7) << depth;
  }
}

TEST(Conditioning, WhatDoesNotCountLeavesNoTraceInWhatDoes) {
  BeamUltrasound us = speckle(convex_beams());
  us.known.assign(us.brightness.size(), 255);
  for (int s = 20; s < 40; ++s) us.known[at(us.beams, s, 7, 4)] = 0;
  const ConditionedUltrasound before = condition(us, no_masks());
  for (int s = 20; s < 40; ++s)
    us.brightness[at(us.beams, s, 7, 4)] = std::numeric_limits<float>::quiet_NaN();
  const ConditionedUltrasound after = condition(us, no_masks());
  EXPECT_EQ(before.samples, after.samples);
  EXPECT_EQ(after.reasons[at(us.beams, 25, 7, 4)], kUnknown);
  EXPECT_EQ(after.samples[at(us.beams, 25, 7, 4)], 0.0F);
}

TEST(Conditioning, FlatUltrasoundCountsNowhereAndIsNotBlownUp) {
  BeamUltrasound us = speckle(convex_beams());
  us.brightness.assign(us.brightness.size(), 77.3F);
  const ConditionedUltrasound flat = condition(us, no_masks());
  EXPECT_EQ(flat.counting(), 0U);
  for (const float value : flat.samples) EXPECT_EQ(value, 0.0F);
  for (const std::uint8_t reasons : flat.reasons) EXPECT_NE(reasons, 0);
}

TEST(Conditioning, GivenDepthsCountAndNoOthers) {
  const BeamUltrasound us = speckle(convex_beams());
  ConditioningOptions options;
  options.depth.min_mm = 12.0;  // samples lie at 2, 3, ... 61 mm
  options.depth.max_mm = 40.0;
  const ConditionedUltrasound result = condition(us, options);
  for (int s = 0; s < 60; ++s)
    EXPECT_EQ((result.reasons[at(us.beams, s, 3, 3)] & kOutsideDepth) != 0, s < 10 || s > 38) << s;
  options.depth.min_mm = 70.0;
  options.depth.max_mm = 90.0;
  EXPECT_THROW(condition(us, options), InputError);
}

TEST(Conditioning, ConstantAndDarkLinesHaveNoContact) {
  BeamUltrasound us = speckle(convex_beams());
  for (int s = 0; s < 60; ++s) {
    us.brightness[at(us.beams, s, 2, 5)] = 90.0F;
    for (int line = 8; line < 13; ++line)
      for (int frame = 0; frame < 9; ++frame)
        us.brightness[at(us.beams, s, line, frame)] *=
            s < 6 ? 1.0F : 0.1F;  // ring-down, then little
  }
  ConditioningOptions options;
  options.depth.automatic = false;
  options.depth.min_mm = 10.0;
  const ConditionedUltrasound result = condition(us, options);
  EXPECT_TRUE(result.reasons[at(us.beams, 30, 2, 5)] & kNoContact);
  EXPECT_TRUE(result.reasons[at(us.beams, 30, 10, 5)] & kNoContact);
  EXPECT_EQ(result.reasons[at(us.beams, 30, 5, 5)], 0);
}

/// A recording that begins before the probe touches: most of its frames show air.
TEST(Conditioning, FramesInAirHaveNoContactHoweverManyThereAre) {
  BeamUltrasound us = speckle(convex_beams());
  constexpr int kInAir = 6;
  for (int frame = 0; frame < kInAir; ++frame)
    for (int line = 0; line < us.beams.lines; ++line)
      for (int s = 0; s < 60; ++s)
        us.brightness[at(us.beams, s, line, frame)] *= s < 6 ? 1.0F : 0.05F;
  ConditioningOptions options;
  options.depth.automatic = false;
  options.depth.min_mm = 10.0;
  const auto without_contact = [&] {
    const ConditionedUltrasound result = condition(us, options);
    int frames = 0;
    for (int frame = 0; frame < us.beams.frames; ++frame) {
      const int reasons = result.reasons[at(us.beams, 30, 5, frame)];
      EXPECT_TRUE(reasons == 0 || reasons == kNoContact) << frame;
      EXPECT_TRUE(frame >= kInAir || reasons == kNoContact || options.no_contact_share == 0.0);
      frames += reasons != 0;
    }
    return frames;
  };
  EXPECT_EQ(without_contact(), kInAir);
  options.no_contact_share = 0.0;
  EXPECT_EQ(without_contact(), 0);
}

TEST(Conditioning, SaturatedSamplesAreLeftOut) {
  BeamUltrasound us = speckle(convex_beams());
  us.brightness[at(us.beams, 30, 5, 5)] = 255.0F;
  const ConditionedUltrasound result = condition(us, {});
  EXPECT_EQ(result.reasons[at(us.beams, 30, 5, 5)], kSaturated);
  EXPECT_EQ(result.reasons[at(us.beams, 31, 5, 5)], 0);
}

TEST(Conditioning, DarkToTheEndIsShadowButADarkLumenIsNot) {
  BeamUltrasound us = speckle(convex_beams());
  for (int frame = 2; frame < 9; ++frame)
    for (int line = 4; line < 9; ++line)
      for (int s = 25; s < 60; ++s)
        us.brightness[at(us.beams, s, line, frame)] *= 0.15F;  // behind a rib
  for (int frame = 0; frame < 9; ++frame)
    for (int line = 11; line < 15; ++line)
      for (int s = 25; s < 40; ++s) us.brightness[at(us.beams, s, line, frame)] *= 0.15F;  // a cyst
  const ConditionedUltrasound result = condition(us, {});
  for (int s = 12; s < 60; ++s) {
    const bool shadow = (result.reasons[at(us.beams, s, 6, 6)] & kShadow) != 0;
    if (s < 23 || s > 27) {  // speckle is averaged over 1.5 mm
      EXPECT_EQ(shadow, s > 27) << s;
    }
    EXPECT_EQ(result.reasons[at(us.beams, s, 13, 6)], 0) << s;
  }
}

/// Speckle with a bright standoff in the first 16 mm, and an oblique wall from sample 45 on.
BeamUltrasound with_standoff_and_wall() {
  BeamUltrasound us = speckle(convex_beams(24, 12));
  for (int frame = 0; frame < 12; ++frame)
    for (int line = 0; line < 24; ++line) {
      for (int s = 0; s < 15; ++s) us.brightness[at(us.beams, s, line, frame)] += 100.0F;
      for (int s = 45 + line / 3; s < 60; ++s) us.brightness[at(us.beams, s, line, frame)] = 230.0F;
    }
  return us;
}

/// As a scanner displays it with another contrast: below 1 it is brighter, above 1 darker.
void display(BeamUltrasound& us, double exponent) {
  for (float& value : us.brightness)
    value = static_cast<float>(255.0 * std::pow(value / 255.0, exponent));
}

TEST(Conditioning, NearFieldIsFoundAndAFarWallCutBeamByBeam) {
  const BeamUltrasound us = with_standoff_and_wall();
  const ConditionedUltrasound result = condition(us, {});
  EXPECT_NEAR(result.min_depth_mm, 17.0, 2.0);  // speckle averaged over 1.5 mm
  EXPECT_EQ(result.far_wall_share, 1.0);
  for (const int line : {0, 12, 23}) {
    int first = 0;
    while ((result.reasons[at(us.beams, first, line, 6)] & kFarWall) == 0) ++first;
    EXPECT_NEAR(first, 45 + line / 3 - 3, 3) << line;  // 3 mm margin
  }
  ConditioningOptions given;
  given.depth.max_mm = 60.0;
  EXPECT_EQ(condition(us, given).far_wall_share, 0.0);
}

/// Air reverberates near the probe, and shows no wall: it says nothing about the depths elsewhere.
TEST(Conditioning, FramesInAirDoNotMoveTheDepths) {
  BeamUltrasound us = with_standoff_and_wall();
  constexpr int kInAir = 7;  // of 12
  for (int frame = 0; frame < kInAir; ++frame)
    for (int line = 0; line < us.beams.lines; ++line)
      for (int s = 0; s < us.beams.samples(); ++s)
        us.brightness[at(us.beams, s, line, frame)] = s < 18 ? 230.0F : 2.0F;
  const ConditionedUltrasound result = condition(us, {});
  ASSERT_NE(result.reasons[at(us.beams, 30, 5, 0)] & kNoContact, 0);
  EXPECT_NEAR(result.min_depth_mm, condition(with_standoff_and_wall(), {}).min_depth_mm, 1.0);
  EXPECT_EQ(result.far_wall_share, 1.0);
  int first = 0;
  while ((result.reasons[at(us.beams, first, 12, 11)] & kFarWall) == 0) ++first;
  EXPECT_NEAR(first, 45 + 12 / 3 - 3, 3);
}

TEST(Conditioning, AFarWallIsTheSameHoweverBrightnessIsDisplayed) {
  const auto excluded = [](double exponent) {
    BeamUltrasound us = with_standoff_and_wall();
    display(us, exponent);
    const ConditionedUltrasound result = condition(us, {});
    EXPECT_EQ(result.far_wall_share, 1.0) << exponent;
    return std::count_if(result.reasons.begin(), result.reasons.end(),
                         [](std::uint8_t reasons) { return (reasons & kFarWall) != 0; });
  };
  const auto usual = static_cast<double>(excluded(1.0));
  constexpr double kBlurred = 1.5;  // samples of each beam: speckle is averaged over 1.5 mm
  for (const double exponent : {0.4, 0.7, 1.5, 2.0})
    EXPECT_NEAR(static_cast<double>(excluded(exponent)), usual, kBlurred * 24 * 12) << exponent;
}

TEST(Conditioning, BrightTissueBehindADarkOrganIsNoFarWall) {
  // A dark organ in fat, which is as bright behind it as in front of it.
  BeamUltrasound dark_organ = speckle(convex_beams(24, 12));
  const Eigen::Vector3d middle = dark_organ.beams.point(6, 12, 30);
  for (int frame = 0; frame < 12; ++frame)
    for (int line = 0; line < 24; ++line)
      for (int s = 0; s < 60; ++s)
        if ((dark_organ.beams.point(frame, line, s) - middle).norm() < 12.0)
          dark_organ.brightness[at(dark_organ.beams, s, line, frame)] *= 0.5F;
  for (const double exponent : {0.3, 0.5, 1.0, 2.0}) {
    BeamUltrasound us = dark_organ;
    display(us, exponent);
    EXPECT_EQ(condition(us, {}).far_wall_share, 0.0) << exponent;
  }
}

TEST(Conditioning, WhereNothingNearerCountsNoFarWallIsFound) {
  ConditioningOptions options;
  options.depth.min_mm = 40.0;  // the deeper half begins at 32 mm
  EXPECT_EQ(condition(with_standoff_and_wall(), options).far_wall_share, 0.0);
}

TEST(Conditioning, ACartesianVolumeIsReadAlongItsBeams) {
  Grid grid;
  grid.size = {3, 5, 4};
  UsVolume volume(grid);
  MaskVolume mask(grid, 255);
  for (std::size_t i = 0; i < volume.voxels.size(); ++i)
    volume.voxels[i] = static_cast<std::uint8_t>(i);
  mask.at(2, 4, 1) = 0;
  for (const char* axis : {"+y", "-y", "+x", "-z"}) {
    const BeamUltrasound us = along_beams(volume, mask, parse_beam_axis(axis, "test"));
    for (int f = 0; f < us.beams.frames; ++f)
      for (int l = 0; l < us.beams.lines; ++l)
        for (int s = 0; s < us.beams.samples(); ++s) {
          const Eigen::Vector3i index =
              us.beams.point(f, l, s).array().round().cast<int>();  // unit grid
          EXPECT_EQ(us.brightness[at(us.beams, s, l, f)],
                    volume.at(index.x(), index.y(), index.z()));
          EXPECT_EQ(us.known[at(us.beams, s, l, f)], mask.at(index.x(), index.y(), index.z()));
        }
  }
  Grid other = grid;
  other.origin_mm.x() = 1.0;
  EXPECT_THROW(along_beams(volume, MaskVolume(other), BeamAxis{}), InputError);
}

TEST(Conditioning, SameBitsForAnyNumberOfThreads) {
  const BeamUltrasound us = speckle(convex_beams());
  const auto conditioned = [&] { return condition(us, {}); };
  const ConditionedUltrasound one = with_threads(1, conditioned);
  const ConditionedUltrasound three = with_threads(3, conditioned);
  EXPECT_EQ(one.samples, three.samples);
  EXPECT_EQ(one.reasons, three.reasons);
}

TEST(Conditioning, RefusesOptionsAndUltrasoundThatAreWrong) {
  const BeamUltrasound us = speckle(convex_beams());
  ConditioningOptions options;
  options.window_mm = 0.0;
  EXPECT_THROW(condition(us, options), InputError);
  options = {};
  options.depth.min_mm = 30.0;
  options.depth.max_mm = 20.0;
  EXPECT_THROW(condition(us, options), InputError);
  BeamUltrasound bad = us;
  bad.brightness[5] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(condition(bad, {}), InputError);
  bad = us;
  bad.brightness.pop_back();
  EXPECT_THROW(condition(bad, {}), InputError);
}

/// A phantom that is small enough for a test; a deep one shows the far side of the tub.
phantom::PhantomCase small_phantom(phantom::SceneKind scene, std::uint64_t seed, double depth_mm) {
  phantom::PhantomOptions options;
  options.scene = scene;
  options.seed = seed;
  options.sweep.samples = 110;
  options.sweep.lines = 40;
  options.sweep.frames = 11;
  options.sweep.lateral_fov_deg = 60.0;
  options.sweep.elevation_fov_deg = 30.0;
  options.sweep.depth_mm = depth_mm;
  options.ct.size = {24, 24, 16};
  options.ct.spacing_mm = {6.0, 6.0, 8.0};
  return phantom::make_phantom(options);
}

double shallowest_target_mm(const phantom::PhantomCase& phantom) {
  const ArrayInverse inverse(phantom.ultrasound.geometry.array, phantom.ultrasound.geometry.axial);
  const MotorisedInverse motor(phantom.ultrasound.geometry);
  double depth_mm = 1e9;
  for (const Eigen::Vector3d& p : phantom.truth.targets_us_mm)
    depth_mm = std::min(depth_mm,
                        phantom.ultrasound.geometry.axial.depth_mm(motor.scan_from_us(p).sample));
  return depth_mm;
}

TEST(Conditioning, OnPhantomsTheNearFieldEndsBeforeTheKidney) {
  for (const auto scene : {phantom::SceneKind::kAgar, phantom::SceneKind::kPatient}) {
    const phantom::PhantomCase phantom = small_phantom(scene, 1, 110.0);
    const ConditionedUltrasound us = condition(along_beams(phantom.ultrasound), {});
    EXPECT_GE(us.min_depth_mm, 10.0);
    EXPECT_LT(us.min_depth_mm, shallowest_target_mm(phantom));
  }
}

TEST(Conditioning, OnADeepPhantomTheTubIsLeftOutAndTheKidneyIsNot) {
  const phantom::PhantomCase phantom = small_phantom(phantom::SceneKind::kAgar, 3, 150.0);
  const ConditionedUltrasound us = condition(along_beams(phantom.ultrasound), {});
  EXPECT_GT(us.far_wall_share, 0.9);
  const MotorisedInverse motor(phantom.ultrasound.geometry);
  int seen = 0;
  int kept = 0;
  for (const Eigen::Vector3d& p : phantom.truth.targets_us_mm) {
    const ScanIndex index = motor.scan_from_us(p);
    const auto sample = static_cast<int>(std::lround(index.sample));
    const auto line = static_cast<int>(std::lround(index.line));
    const auto frame = static_cast<int>(std::lround(index.frame));
    if (sample < 0 || sample >= 110 || line < 0 || line >= 40 || frame < 0 || frame >= 11) continue;
    ++seen;
    kept += (us.reasons[phantom.ultrasound.offset(sample, line, frame)] & kFarWall) == 0 ? 1 : 0;
  }
  EXPECT_GT(seen, 20);
  EXPECT_GT(kept, seen * 95 / 100);
}

}  // namespace
}  // namespace usct::test
