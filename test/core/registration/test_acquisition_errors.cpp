#include <gtest/gtest.h>

#include "registration_cases.h"
#include "us_ct_registration/registration/registration.h"

/// Errors of the acquisition that the refinement estimates on request. The estimate of a phantom is
/// biased by its long pulse; two estimates share this bias, so their difference is tested.
namespace usct::test {
namespace {

double sweep_error_if_recorded(double factor) {
  PreScanVolume us = agar_phantom().ultrasound;
  for (double& angle_rad : std::get<MotorSweep>(us.geometry.motion).frame_angles_rad)
    angle_rad *= factor;
  const RegistrationCase images = case_of(agar_phantom(), us);
  const RegistrationOptions options = quick_options(
      "conditioning_spacing_mm: 1.1\nrefinement: {spacing_mm: 1, sweep_error: 0.15}\n");
  return register_ultrasound(images.us, images.ct, images.T_us_ct_true, options)
      .measures.sweep_error.value();
}

TEST(AcquisitionErrorsOfARegistration, SweepErrorUndoesWrongMotorAngles) {
  constexpr double kFactor = 1.06;
  constexpr double kWanted = kFactor - 1.0 / kFactor;
  EXPECT_NEAR(sweep_error_if_recorded(1.0 / kFactor) - sweep_error_if_recorded(kFactor), kWanted,
              0.2 * kWanted);
}

}  // namespace
}  // namespace usct::test
