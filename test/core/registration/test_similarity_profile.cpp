#include <gtest/gtest.h>

#include <algorithm>

#include "core/io/expect_input_error.h"
#include "core/registration/registration_cases.h"
#include "ultrasound/stray_frames.h"
#include "us_ct_registration/registration/similarity_profile.h"

namespace usct::test {
namespace {

using Profiles = std::array<SimilarityProfile, 6>;

Profiles profiles_of(const RegistrationCase& images, const Eigen::Isometry3d& T_us_ct,
                     const RegistrationOptions& options) {
  ProfileOptions profile;
  profile.steps = 6;
  return similarity_profiles(images.us, images.ct, T_us_ct, middle_us_mm(images), options, profile);
}

double offset_of_best(const SimilarityProfile& profile) {
  const auto best = std::max_element(profile.values.begin(), profile.values.end());
  return profile.offsets[static_cast<std::size_t>(best - profile.values.begin())];
}

TEST(SimilarityProfile, PeaksAtTheTruthOnAllAxes) {
  for (const char* name : {"fast", "patient"}) {
    const Profiles profiles = profiles_of(agar_case(), agar_case().T_us_ct_true, preset(name));
    for (int axis = 0; axis < 6; ++axis) {
      const SimilarityProfile& profile = profiles[static_cast<std::size_t>(axis)];
      ASSERT_EQ(profile.offsets.size(), 13U);
      EXPECT_DOUBLE_EQ(profile.offsets.front(), axis < 3 ? -15.0 : -radians(15.0));
      EXPECT_DOUBLE_EQ(profile.offsets.back(), axis < 3 ? 15.0 : radians(15.0));
      EXPECT_EQ(offset_of_best(profile), 0.0) << name << ", axis " << axis;
      // All axes meet at the pose itself.
      EXPECT_EQ(profile.values[6], profiles[0].values[6]);
    }
  }
}

/// The profile through a pose 5 mm or 5 degrees beside the truth peaks at the way back, so that
/// axes, signs and units are those that are documented.
TEST(SimilarityProfile, PointsBackFromAPoseBesideTheTruth) {
  for (int axis = 0; axis < 6; ++axis) {
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis % 3);
    const Eigen::Isometry3d beside =
        axis < 3 ? beside_truth(agar_case(), Eigen::Vector3d::Zero(), 5.0 * unit)
                 : beside_truth(agar_case(), 5.0 * unit, Eigen::Vector3d::Zero());
    const Profiles profiles = profiles_of(agar_case(), beside, preset("fast"));
    EXPECT_NEAR(offset_of_best(profiles[static_cast<std::size_t>(axis)]),
                axis < 3 ? -5.0 : -radians(5.0), 1e-12)
        << "axis " << axis;
  }
}

/// A frame with a wrong pose of the tracker is left out, as it is from a registration.
TEST(SimilarityProfile, IsThatOfTheFramesOnTheProbesPath) {
  RegistrationCase recorded = agar_case();
  recorded.us.beams.tracked = true;
  RegistrationCase with_stray = recorded;
  const int stray = recorded.us.beams.frames / 3;
  for (int line = 0; line < recorded.us.beams.lines; ++line)
    with_stray.us.beams.beams[static_cast<std::size_t>(stray * recorded.us.beams.lines + line)]
        .origin_mm.x() += 100.0;
  const auto profiles = [&](const BeamUltrasound& us) {
    return similarity_profiles(us, recorded.ct, recorded.T_us_ct_true, middle_us_mm(recorded),
                               preset("fast"), {15.0, radians(15.0), 2});
  };
  const Profiles expected = profiles(without_frames(recorded.us, {stray}));
  const Profiles found = profiles(with_stray.us);
  for (std::size_t axis = 0; axis < 6; ++axis) EXPECT_EQ(found[axis].values, expected[axis].values);
  for (Beam& beam : with_stray.us.beams.beams)
    if (&beam >= &with_stray.us.beams.beams[with_stray.us.beams.beams.size() / 2])
      beam.origin_mm.x() += 300.0;
  expect_input_error([&] { profiles(with_stray.us); }, {"lie", "mm apart"});
}

TEST(SimilarityProfile, WhatCannotBeRegisteredIsAnError) {
  const Eigen::Isometry3d far = Eigen::Translation3d(0.0, 900.0, 0.0) * agar_case().T_us_ct_true;
  expect_input_error([&] { profiles_of(agar_case(), far, preset("fast")); },
                     {"similarity profile", "near"});
  ProfileOptions none;
  none.steps = 0;
  expect_input_error([&] { none.validate("p"); }, {"'steps' is 0"});
}

}  // namespace
}  // namespace usct::test
