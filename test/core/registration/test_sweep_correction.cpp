#include <gtest/gtest.h>

#include "registration/sweep_correction.h"

namespace usct::test {
namespace {

using registration::correction_holds;
using registration::Outcome;
using registration::Refusal;
using registration::Registration;

Registration with_similarity(double similarity, RegistrationStatus status) {
  Registration registration;
  registration.result.status = status;
  registration.result.similarity = similarity;
  return registration;
}

Registration accepted(double similarity) {
  return with_similarity(similarity, RegistrationStatus::kRegistered);
}

const Registration kRecorded = with_similarity(0.08, RegistrationStatus::kLowConfidence);

TEST(SweepCorrection, HoldsIfTheUltrasoundFitsBetterWithIt) {
  EXPECT_TRUE(correction_holds(kRecorded, accepted(0.09)));
  EXPECT_FALSE(correction_holds(kRecorded, accepted(0.077)));
  EXPECT_FALSE(correction_holds(accepted(0.08), accepted(0.077)));
}

TEST(SweepCorrection, DoesNotHoldIfThePoseIsRefusedOrTheSweepStillLooksWrong) {
  EXPECT_FALSE(
      correction_holds(kRecorded, with_similarity(0.09, RegistrationStatus::kLowConfidence)));
  EXPECT_FALSE(correction_holds(kRecorded, Refusal{RegistrationStatus::kNoOverlap, ""}));
  Registration shown = accepted(0.09);
  shown.result.measures.sweep_error = 0.1;
  shown.result.measures.errors_ratio = 1.5;
  shown.result.measures.errors_advantage = 6.0;
  EXPECT_FALSE(correction_holds(kRecorded, shown));
}

TEST(SweepCorrection, DoesNotCompareValuesOfDifferentSimilarities) {
  Registration of_blocks = with_similarity(0.15, RegistrationStatus::kRegistered);
  of_blocks.by_matched_blocks = true;
  EXPECT_TRUE(correction_holds(of_blocks, accepted(0.05)));
  Registration by_patient = accepted(0.15);
  by_patient.by_patient = true;
  EXPECT_TRUE(correction_holds(by_patient, accepted(0.05)));
}

}  // namespace
}  // namespace usct::test
