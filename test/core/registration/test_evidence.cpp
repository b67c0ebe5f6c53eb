#include <gtest/gtest.h>

#include "registration/evidence.h"

namespace usct::test {
namespace {

using registration::is_beyond_doubt;

constexpr double kPresetLimit = 0.3;

Measures measures(double wrong_probability, double local_agreement, double mirror_ratio = 1.3) {
  Measures of_pose;
  of_pose.mirror_ratio = mirror_ratio;
  of_pose.wrong_probability = wrong_probability;
  of_pose.local_agreement = local_agreement;
  return of_pose;
}

TEST(BeyondDoubt, APoseWhoseProbabilityIsFarBelowItsLimit) {
  EXPECT_TRUE(is_beyond_doubt(measures(0.02, 0.6), kPresetLimit));
  EXPECT_FALSE(is_beyond_doubt(measures(0.04, 0.6), kPresetLimit));
}

/// A CT with two axes exchanged fitted its nearly symmetric kidney with these measures, 41 mm off.
TEST(BeyondDoubt, NotIfBlocksAgreeHalfway) {
  EXPECT_FALSE(is_beyond_doubt(measures(0.024, 0.333), kPresetLimit));
}

/// Another one fitted its mirror image as well, in two trials.
TEST(BeyondDoubt, NotIfAMirrorImageFitsAsWell) {
  EXPECT_FALSE(is_beyond_doubt(measures(0.027, 0.483, 0.994), kPresetLimit));
  EXPECT_FALSE(is_beyond_doubt(measures(0.026, 0.483, 1.002), kPresetLimit));
}

TEST(BeyondDoubt, NotWithoutEvidence) {
  EXPECT_FALSE(is_beyond_doubt({}, kPresetLimit));
  Measures without_blocks = measures(0.02, 0.6);
  without_blocks.local_agreement.reset();
  EXPECT_FALSE(is_beyond_doubt(without_blocks, kPresetLimit));
  Measures without_mirrors = measures(0.02, 0.6);
  without_mirrors.mirror_ratio.reset();
  EXPECT_FALSE(is_beyond_doubt(without_mirrors, kPresetLimit));
}

}  // namespace
}  // namespace usct::test
