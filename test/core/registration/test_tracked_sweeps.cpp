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

/// How far the pose of this case lies from that of the sweep as it was simulated.
double change_mm(const RegistrationCase& images, const RegistrationResult& result) {
  static const RegistrationResult simulated = registered(patient_case(), nearby(patient_case()));
  if (!simulated.T_us_ct || !result.T_us_ct) {
    ADD_FAILURE() << simulated.message << "; " << result.message;
    return 0.0;
  }
  return evaluate_targets(*result.T_us_ct, *simulated.T_us_ct, images.targets_us_mm).mean_mm;
}

TEST(TrackedSweeps, AProbeThatRestsChangesNothing) {
  const RegistrationCase images = resting_first(patient_case());
  EXPECT_LT(change_mm(images, registered(images, nearby(images))), 0.01);
}

/// Three of 36 frames, by as much as a tracker that takes another marker for its own.
TEST(TrackedSweeps, WrongPosesOfFewFramesChangeLittle) {
  RegistrationCase images = patient_case();
  BeamGrid& beams = images.us.beams;
  for (const int frame : {3, 17, 18})
    for (int line = 0; line < beams.lines; ++line)
      beams.beams[static_cast<std::size_t>(frame * beams.lines + line)].origin_mm.x() += 1e4;
  const RegistrationResult result = registered(images, nearby(images));
  EXPECT_LT(change_mm(images, result), 0.3);
  EXPECT_NE(result.message.find("of 3 of 36 frames, frame 3 first"), std::string::npos)
      << result.message;
}

}  // namespace
}  // namespace usct::test
