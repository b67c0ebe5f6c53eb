#include <gtest/gtest.h>

#include "registration/as_patient.h"

namespace usct::test {
namespace {

/// What a user has asked for holds as well where a coarse preset hands its doubts on to `patient`.
TEST(AsPatient, KeepsWhatWasAskedFor) {
  RegistrationOptions options;
  options.seed = 77;
  options.correct_sweep = false;
  options.search.rounds = 3;
  options.confidence.gates.max_wrong_probability = 0.12;
  options.confidence.evidence = EvidenceSource::kOwnFirst;
  const RegistrationOptions patient = registration::as_patient(options);
  EXPECT_EQ(patient.seed, 77U);
  EXPECT_FALSE(patient.correct_sweep);
  EXPECT_EQ(patient.search.rounds, 3);
  EXPECT_EQ(patient.confidence.gates.max_wrong_probability, 0.12);
  EXPECT_EQ(patient.confidence.evidence, EvidenceSource::kOwn);  // else it would go on for ever
}

TEST(AsPatient, SearchesAsFarAsTheOptionsAndNoLessThanItself) {
  const StartOptions own = RegistrationOptions().search.starts.value();
  const auto starts = [&](const std::optional<StartOptions>& asked) {
    RegistrationOptions options;
    options.search.starts = asked;
    return registration::as_patient(options).search.starts.value();
  };
  const auto expect_own = [&](const StartOptions& found) {
    EXPECT_EQ(found.count, own.count);
    EXPECT_EQ(found.rotation_rad, own.rotation_rad);
    EXPECT_EQ(found.translation_mm, own.translation_mm);
  };
  expect_own(starts(std::nullopt));
  expect_own(starts(StartOptions{StartRegion::kBox, 8, 0.5 * own.rotation_rad, 5.0}));
  for (const auto& [turn, shift] : {std::pair(1.5, 1.0), std::pair(1.0, 1.5)}) {
    const StartOptions wide{StartRegion::kBall, 8, turn * own.rotation_rad,
                            shift * own.translation_mm};
    const StartOptions found = starts(wide);
    EXPECT_EQ(found.region, StartRegion::kBall);
    EXPECT_EQ(found.rotation_rad, wide.rotation_rad);
    EXPECT_EQ(found.translation_mm, wide.translation_mm);
    EXPECT_EQ(found.count, own.count);  // a wider region needs no fewer of them
  }
  const StartOptions far =
      starts(StartOptions{StartRegion::kBox, 8, 0.2 * own.rotation_rad, 2.0 * own.translation_mm});
  EXPECT_EQ(far.rotation_rad, own.rotation_rad);
  EXPECT_EQ(far.translation_mm, 2.0 * own.translation_mm);
}

}  // namespace
}  // namespace usct::test
