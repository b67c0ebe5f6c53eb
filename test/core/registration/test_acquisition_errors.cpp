#include <gtest/gtest.h>

#include "registration_cases.h"
#include "us_ct_registration/registration/registration.h"

/// Errors of the acquisition: the refinement estimates them on request, a check of the final pose
/// always. The estimate of a phantom is biased by its long pulse; two estimates share this bias, so
/// that their difference is tested.
namespace usct::test {
namespace {

/// The registration, from the truth, of a phantom whose motor angles are recorded too large by
/// `factor`.
RegistrationResult if_recorded(double factor, const std::string& changes) {
  PreScanVolume us = agar_phantom().ultrasound;
  for (double& angle_rad : std::get<MotorSweep>(us.geometry.motion).frame_angles_rad)
    angle_rad *= factor;
  const RegistrationCase images = case_of(agar_phantom(), us);
  return register_ultrasound(images.us, images.ct, images.T_us_ct_true, quick_options(changes));
}

double sweep_error_if_recorded(double factor) {
  return if_recorded(
             factor,
             "conditioning_spacing_mm: 1.1\nrefinement: {spacing_mm: 1, sweep_error: 0.15}\n")
      .measures.sweep_error.value();
}

TEST(AcquisitionErrorsOfARegistration, SweepErrorUndoesWrongMotorAngles) {
  constexpr double kFactor = 1.06;
  constexpr double kWanted = kFactor - 1.0 / kFactor;
  EXPECT_NEAR(sweep_error_if_recorded(1.0 / kFactor) - sweep_error_if_recorded(kFactor), kWanted,
              0.2 * kWanted);
}

TEST(AcquisitionErrorsOfARegistration, AWrongMotorStepIsNamedWithoutBeingAskedFor) {
  EXPECT_EQ(if_recorded(1.0, "").message, "all gates passed");
  const RegistrationResult wide = if_recorded(1.2, "");
  EXPECT_NE(wide.message.find("closer together: check the motor's step"), std::string::npos)
      << wide.message;
  const RegistrationResult narrow = if_recorded(1.0 / 1.2, "");
  EXPECT_NE(narrow.message.find("farther apart: check the motor's step"), std::string::npos)
      << narrow.message;
}

}  // namespace
}  // namespace usct::test
