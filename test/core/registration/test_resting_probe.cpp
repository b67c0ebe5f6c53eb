#include <gtest/gtest.h>

#include "core/registration/registration_cases.h"

namespace usct::test {
namespace {

/// A tracked sweep whose first frame was recorded 150 times, before the probe began to move.
RegistrationCase resting_first(RegistrationCase images) {
  BeamUltrasound& us = images.us;
  const std::vector<Beam> beams(us.beams.beams.begin(), us.beams.beams.begin() + us.beams.lines);
  const std::vector<float> brightness(us.brightness.begin(),
                                      us.brightness.begin() + us.beams.lines * us.beams.samples());
  for (int i = 0; i < 149; ++i) {
    us.beams.beams.insert(us.beams.beams.begin(), beams.begin(), beams.end());
    us.brightness.insert(us.brightness.begin(), brightness.begin(), brightness.end());
    ++us.beams.frames;
  }
  return images;
}

TEST(RestingProbe, ChangesNothing) {
  const RegistrationCase& images = patient_case();
  const RegistrationResult moving = registered(images, nearby(images));
  const RegistrationResult resting = registered(resting_first(images), nearby(images));
  ASSERT_TRUE(moving.T_us_ct) << moving.message;
  ASSERT_TRUE(resting.T_us_ct) << resting.message;
  EXPECT_LT(evaluate_targets(*resting.T_us_ct, *moving.T_us_ct, images.targets_us_mm).mean_mm,
            0.01);
}

}  // namespace
}  // namespace usct::test
