#include <gtest/gtest.h>

#include "core/registration/registration_cases.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/registration/tracking.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

bool was_full(const RegistrationResult& result) { return result.seconds.count("search") == 1; }

/// The ultrasound as the probe records it with its lines in the reverse order.
BeamUltrasound lines_reversed(BeamUltrasound us) {
  const auto samples = us.beams.samples();
  for (std::size_t row = 0; row < us.brightness.size();
       row += static_cast<std::size_t>(us.beams.lines * samples))
    for (int l = 0; l < us.beams.lines / 2; ++l) {
      const auto line = [&](int at) { return us.brightness.begin() + row + at * samples; };
      std::swap_ranges(line(l), line(l + 1), line(us.beams.lines - 1 - l));
    }
  return us;
}

class Tracking : public testing::Test {
 protected:
  RegistrationResult next(const BeamUltrasound& us, const Isometry3d& T_us_ct_initial) {
    return tracker_.next(us, ct_, T_us_ct_initial);
  }
  void expect_right(const RegistrationResult& result, const Isometry3d& T_us_ct_true) {
    ASSERT_TRUE(result.T_us_ct) << result.message;
    EXPECT_LT(evaluate_targets(*result.T_us_ct, T_us_ct_true, images_.targets_us_mm).mean_mm, 1.0);
  }

  const RegistrationCase& images_ = agar_case();
  const PreparedCt ct_{images_.ct, quick_options()};
  RegistrationTracker tracker_{quick_options(), {3}};
};

TEST_F(Tracking, OneOfSoManyRegistrationsIsFull) {
  Isometry3d T_us_ct = nearby(images_);
  for (int i = 0; i < 4; ++i) {
    const RegistrationResult result = next(images_.us, T_us_ct);
    EXPECT_EQ(was_full(result), i % 3 == 0) << i;
    expect_right(result, images_.T_us_ct_true);
    T_us_ct = *result.T_us_ct;
  }
}

TEST_F(Tracking, FollowsTheProbe) {
  const RegistrationResult first = next(images_.us, nearby(images_));
  ASSERT_TRUE(first.T_us_ct);
  const Isometry3d T_now_before = rigid(Vector3d(0.05, -0.04, 0.1), Vector3d(4.0, -3.0, 5.0));
  const BeamUltrasound moved_us = moved(images_.us, T_now_before);
  const RegistrationResult second = next(moved_us, T_now_before * *first.T_us_ct);
  EXPECT_FALSE(was_full(second));
  expect_right(second, T_now_before * images_.T_us_ct_true);
  EXPECT_TRUE(second.measures.mirror_ratio && second.measures.rival_ratio &&
              second.measures.local_agreement && second.covariance);
}

/// What the first registration has shown of the motor holds for those that follow.
TEST_F(Tracking, ACorrectedSweepStaysCorrected) {
  const RegistrationCase uneven = slow_on_one_side(1.25, 1.0);
  const RegistrationResult first = next(uneven.us, nearby(uneven));
  ASSERT_TRUE(first.T_us_ct) << first.message;
  const RegistrationResult second = next(uneven.us, *first.T_us_ct);
  EXPECT_FALSE(was_full(second));
  ASSERT_TRUE(second.T_us_ct) << second.message;
  EXPECT_LT(evaluate_targets(*second.T_us_ct, *first.T_us_ct, uneven.targets_us_mm).mean_mm, 0.3);
  EXPECT_NEAR(*second.measures.sweep_unevenness, *first.measures.sweep_unevenness, 0.03);
  EXPECT_NE(second.message.find("the frames were taken to lie"), std::string::npos);
}

/// The motor is slow on the other side on its way back. With the correction of its way there the
/// images would still show a pose, up to 5 mm beside the right one.
TEST_F(Tracking, ACorrectionThatNoLongerHoldsIsDropped) {
  const RegistrationCase there = slow_on_one_side(1.25, 1.0);
  for (const double slow : {1.2, 1.5}) {
    tracker_.forget();
    const RegistrationResult first = next(there.us, nearby(there));
    ASSERT_TRUE(first.T_us_ct) << first.message;
    EXPECT_NE(first.message.find("the frames were taken to lie"), std::string::npos);
    const RegistrationCase back = slow_on_one_side(1.0, slow);
    const RegistrationResult second = next(back.us, *first.T_us_ct);
    tracker_.forget();
    const RegistrationResult alone = next(back.us, *first.T_us_ct);
    EXPECT_EQ(second.status, alone.status) << slow;
    ASSERT_EQ(second.T_us_ct.has_value(), alone.T_us_ct.has_value()) << slow;
    if (second.T_us_ct) {
      EXPECT_EQ(second.T_us_ct->matrix(), alone.T_us_ct->matrix()) << slow;
      EXPECT_LT(back.error_mm(*second.T_us_ct), *second.measures.error_bound_mm) << slow;
    }
    EXPECT_LT(*second.measures.sweep_unevenness, -0.02) << slow;
  }
}

/// Climbs that follow the trail reach as far as rivals are, but not less far than a climb can.
TEST_F(Tracking, NearRivalsAreFollowedByWideSteps) {
  RegistrationTracker tracker(
      quick_options("confidence: {rival_mm: 1}\n"
                    "search: {levels: {1: {optimizer: {step_tolerance: 0.6}}}}\n"),
      {3});
  const RegistrationResult first = tracker.next(images_.us, ct_, nearby(images_));
  ASSERT_TRUE(first.T_us_ct) << first.message;
  EXPECT_NO_THROW(tracker.next(images_.us, ct_, *first.T_us_ct));
}

TEST_F(Tracking, WhatMovedTooFarIsSearchedFor) {
  ASSERT_TRUE(next(images_.us, nearby(images_)).T_us_ct);
  const RegistrationResult result =
      next(images_.us, beside_truth(images_, Vector3d(0, 12, 0), Vector3d(10, 0, 8)));
  EXPECT_TRUE(was_full(result));
  expect_right(result, images_.T_us_ct_true);
}

TEST_F(Tracking, MirroredUltrasoundIsRefused) {
  const RegistrationResult first = next(images_.us, nearby(images_));
  ASSERT_TRUE(first.T_us_ct);
  const RegistrationResult second = next(lines_reversed(images_.us), *first.T_us_ct);
  EXPECT_TRUE(was_full(second));
  EXPECT_FALSE(second.T_us_ct);
}

TEST_F(Tracking, AnotherCtOrProbeOrARequestToForgetMakesItFull) {
  const RegistrationResult first = next(images_.us, nearby(images_));
  ASSERT_TRUE(first.T_us_ct);
  const PreparedCt again(images_.ct, quick_options());
  EXPECT_TRUE(was_full(tracker_.next(images_.us, again, *first.T_us_ct)));
  EXPECT_FALSE(was_full(tracker_.next(images_.us, again, *first.T_us_ct)));
  tracker_.forget();
  EXPECT_TRUE(was_full(tracker_.next(images_.us, again, *first.T_us_ct)));
  BeamUltrasound fewer = images_.us;
  --fewer.beams.frames;
  const auto lines = static_cast<std::size_t>(fewer.beams.lines);
  fewer.beams.beams.resize(fewer.beams.beams.size() - lines);
  fewer.brightness.resize(fewer.brightness.size() -
                          lines * static_cast<std::size_t>(fewer.beams.samples()));
  if (!fewer.known.empty()) fewer.known.resize(fewer.brightness.size());
  EXPECT_TRUE(was_full(tracker_.next(fewer, again, *first.T_us_ct)));
}

TEST_F(Tracking, OtherDepthsMakeItFull) {
  const RegistrationResult first = next(images_.us, nearby(images_));
  ASSERT_TRUE(first.T_us_ct);
  BeamUltrasound deeper = images_.us;
  deeper.beams.axial.start_depth_mm += 0.5;
  EXPECT_TRUE(was_full(next(deeper, *first.T_us_ct)));
  BeamUltrasound longer = deeper;
  longer.beams.axial.spacing_mm *= 1.005;
  EXPECT_TRUE(was_full(next(longer, *first.T_us_ct)));
}

/// With a limit as low as this, the evidence of `phantom` leaves doubt.
TEST_F(Tracking, WhatThePresetPatientFoundIsTrackedAsPatientTracks) {
  const char* const in_doubt = "confidence: {gates: {max_wrong_probability: 0.1}}\n";
  RegistrationTracker tracker(quick_options(in_doubt), {3});
  RegistrationTracker by_patient(
      parse_registration_options(std::string("preset: patient\nsearch: {rounds: 1}\n") + in_doubt,
                                 "test"),
      {3});
  Isometry3d T_us_ct = nearby(images_);
  for (int i = 0; i < 4; ++i) {
    const RegistrationResult result = tracker.next(images_.us, ct_, T_us_ct);
    const RegistrationResult expected = by_patient.next(images_.us, ct_, T_us_ct);
    EXPECT_EQ(was_full(result), i % 3 == 0) << i;
    expect_right(result, images_.T_us_ct_true);
    EXPECT_EQ(result.T_us_ct->matrix(), expected.T_us_ct.value().matrix()) << i;
    EXPECT_EQ(result.measures.mirror_ratio, expected.measures.mirror_ratio) << i;
    T_us_ct = *result.T_us_ct;
  }
}

TEST_F(Tracking, WithoutEvidenceEveryRegistrationIsFull) {
  RegistrationTracker blind(quick_options("confidence: {gates: {max_wrong_probability: none}}\n"));
  for (int i = 0; i < 2; ++i)
    EXPECT_TRUE(was_full(blind.next(images_.us, ct_, images_.T_us_ct_true)));
}

TEST(TrackingOptions, AreValidated) {
  EXPECT_THROW(RegistrationTracker(quick_options(), {0}), InputError);
  EXPECT_THROW(RegistrationTracker(quick_options(), {1, -1.0}), InputError);
}

}  // namespace
}  // namespace usct::test
