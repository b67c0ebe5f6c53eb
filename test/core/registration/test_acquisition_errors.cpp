#include <gtest/gtest.h>

#include "registration_cases.h"
#include "us_ct_registration/registration/registration.h"

/// Errors of the acquisition, which a check of the final pose estimates. The estimate of a phantom
/// is biased by its long pulse; two estimates share this bias, so that their differences are
/// tested.
namespace usct::test {
namespace {

/// The registration, from the truth, of a phantom whose motor angles are recorded too large.
RegistrationResult if_recorded(double factor, const std::string& changes) {
  const RegistrationCase images = slow_on_one_side(factor, factor);
  return register_ultrasound(images.us, images.ct, images.T_us_ct_true, quick_options(changes));
}

double sweep_error_if_recorded(double factor) {
  return if_recorded(factor, "correct_sweep: false\n").measures.sweep_error.value();
}

/// Where a single estimate ends along its flat optimum differs by some 2 % between processors; the
/// slope over four of them does so by a sixth.
TEST(AcquisitionErrorsOfARegistration, SweepErrorUndoesWrongMotorAngles) {
  double products = 0.0, squares = 0.0;
  for (const double larger : {1.1, 1.06}) {
    const double wanted = 1.0 / larger - larger;
    products += wanted * (sweep_error_if_recorded(larger) - sweep_error_if_recorded(1.0 / larger));
    squares += wanted * wanted;
  }
  EXPECT_NEAR(products / squares, 1.0, 0.4);
}

TEST(AcquisitionErrorsOfARegistration, AWrongMotorStepIsNamedWithoutBeingAskedFor) {
  EXPECT_EQ(if_recorded(1.0, "").message, "all gates passed");
  const RegistrationResult wide = if_recorded(1.2, "");
  EXPECT_NE(wide.message.find("closer together"), std::string::npos) << wide.message;
  EXPECT_NE(wide.message.find(": check the motor's step"), std::string::npos) << wide.message;
  EXPECT_EQ(wide.message.find("check depth"), std::string::npos) << wide.message;
  const RegistrationResult narrow = if_recorded(1.0 / 1.2, "");
  EXPECT_NE(narrow.message.find("farther apart"), std::string::npos) << narrow.message;
  EXPECT_NE(narrow.message.find(": check the motor's step"), std::string::npos) << narrow.message;
}

/// A motor that is slow on one side moves the best pose of all frames together. Registered with the
/// frames where the images show that they lie, the kidney lies closer to its place. A single
/// estimate may be off by some per cent of a side, so that the errors of four are added.
TEST(AcquisitionErrorsOfARegistration, ASweepThatIsSlowOnOneSideIsCorrected) {
  double recorded_mm = 0.0, corrected_mm = 0.0;
  for (const auto& [before, after] :
       {std::pair(1.25, 1.0), std::pair(1.0, 1.25), std::pair(0.8, 1.0), std::pair(1.0, 0.8)}) {
    SCOPED_TRACE(before);
    const RegistrationCase images = slow_on_one_side(before, after);
    const RegistrationResult as_recorded =
        registered(images, images.T_us_ct_true, quick_options("correct_sweep: false\n"));
    const RegistrationResult corrected = registered(images, images.T_us_ct_true);
    ASSERT_EQ(corrected.status, RegistrationStatus::kRegistered) << corrected.message;
    recorded_mm += images.error_mm(as_recorded.candidates.front().T_us_ct);
    corrected_mm += images.error_mm(*corrected.T_us_ct);
    const double sweep = *corrected.measures.sweep_error;
    const double unevenness = *corrected.measures.sweep_unevenness;
    EXPECT_NEAR(sweep - unevenness, 1.0 / before - 1.0, 0.1);
    EXPECT_NEAR(sweep + unevenness, 1.0 / after - 1.0, 0.1);
    EXPECT_NE(corrected.message.find("the frames were taken to lie"), std::string::npos);
    EXPECT_EQ(as_recorded.message.find("were taken"), std::string::npos);
  }
  EXPECT_LT(corrected_mm, 0.8 * recorded_mm);
}

/// A sweep that is recorded 20 % too wide stretches tissue by some millimetres at both ends. It is
/// the same anatomy nevertheless: with the error that the images show, its blocks agree.
TEST(AcquisitionErrorsOfARegistration, EvidenceIsGatheredWithTheErrorsThatTheImagesShow) {
  const Measures right = if_recorded(1.0, "").measures;
  for (const double factor : {1.2, 1.0 / 1.2}) {
    const RegistrationResult wrong = if_recorded(factor, "");
    ASSERT_EQ(wrong.status, RegistrationStatus::kRegistered) << wrong.message;
    EXPECT_GT(*wrong.measures.local_agreement, *right.local_agreement - 0.1) << factor;
    EXPECT_LT(*wrong.measures.tissue_motion_mm, *right.tissue_motion_mm + 0.7) << factor;
    EXPECT_GT(*wrong.measures.expected_error_mm, *right.expected_error_mm) << factor;
  }
}

/// Wrong depths are made up for by the pose, so that the kidney fits and lies in the wrong place.
TEST(AcquisitionErrorsOfARegistration, WrongDepthsAreNamedAndCountInTheExpectedError) {
  const auto named = [](double factor, const std::string& words) {
    PreScanVolume us = agar_phantom().ultrasound;
    us.geometry.axial.start_depth_mm *= factor;
    us.geometry.axial.spacing_mm *= factor;
    const RegistrationCase images = case_of(agar_phantom(), us);
    const RegistrationResult result =
        register_ultrasound(images.us, images.ct, images.T_us_ct_true, quick_options(""));
    const double moved_mm = images.error_mm(result.candidates.front().T_us_ct);
    EXPECT_GT(moved_mm, 2.0);
    EXPECT_GT(*result.measures.error_bound_mm, moved_mm);
    EXPECT_NE(result.message.find(words + ": check depth and sample spacing"), std::string::npos)
        << result.message << " " << *result.measures.depth_error;
  };
  named(1.07, "smaller");
  named(1.0 / 1.07, "larger");
}

}  // namespace
}  // namespace usct::test
