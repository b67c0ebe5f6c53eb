#include <gtest/gtest.h>

#include "registration/evidence/doubts.h"
#include "us_ct_registration/registration/right_probability.h"

namespace usct::test {
namespace {

using registration::doubted_for_mirrored_ct;
using registration::if_no_mirror_agrees;
using registration::if_parts_agree;
using registration::is_beyond_doubt;
using registration::may_be_in_mirrored_ct;
using registration::may_be_near;

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

/// Others fitted their mirror images almost as well, and were beyond doubt otherwise.
TEST(MirroredCt, IsSearchedForWhereAMirrorImageFitsAlmostAsWell) {
  for (const double ratio : {1.054, 1.251}) {
    EXPECT_TRUE(is_beyond_doubt(measures(0.022, 0.449, ratio), kPresetLimit));
    EXPECT_TRUE(may_be_in_mirrored_ct(measures(0.022, 0.449, ratio), false, kPresetLimit));
  }
  EXPECT_FALSE(may_be_in_mirrored_ct(measures(0.022, 0.449, 1.5), false, kPresetLimit));
  EXPECT_TRUE(may_be_in_mirrored_ct(measures(0.04, 0.449, 1.5), false, kPresetLimit));
}

/// Ultrasound a third of whose lines had no contact fitted a CT with exchanged axes, and was beyond
/// doubt with these measures.
TEST(MirroredCt, IsSearchedForWhereTheFieldLacksASide) {
  EXPECT_TRUE(is_beyond_doubt(measures(0.022, 0.474, 1.645), kPresetLimit));
  EXPECT_TRUE(may_be_in_mirrored_ct(measures(0.022, 0.474, 1.645), true, kPresetLimit));
}

/// Mirrored ultrasound that fits better than the pose shows that the right one is far, and so do
/// blocks that agree no more than by chance.
TEST(NearTheRightPose, UnlessAMirrorImageFitsBetterOrBlocksAgreeByChance) {
  EXPECT_TRUE(may_be_near(measures(1.0, 0.05, 1.0)));
  EXPECT_FALSE(may_be_near(measures(0.4, 0.3, 0.99)));
  EXPECT_FALSE(may_be_near(measures(1.0, 0.0, 1.5)));
  EXPECT_FALSE(may_be_near(measures(1.0, -0.02, 1.5)));
  EXPECT_TRUE(may_be_near({}));
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

/// A pose in a CT with exchanged axes whose blocks agree more than those of its mirror images, and
/// more than they do at the right pose.
Measures of_exchanged_axes() {
  Measures of_pose = measures(0.11, 0.494, 0.981);
  of_pose.displacement_mm = 29.6;
  of_pose.mirror_advantage = 1.11;
  of_pose.mirror_agreement = 0.388;
  of_pose.local_advantage = 5.0;
  of_pose.rival_ratio = 2.71;
  of_pose.rival_advantage = 3.0;
  of_pose.parts_mm = 1.0;
  of_pose.tissue_motion_mm = 0.284;
  return of_pose;
}

TEST(DoubtedForMirroredCt, BlocksDoNotMakeUpForAMirroredCtThatFitsBetter) {
  const std::optional<Measures> doubted = doubted_for_mirrored_ct(of_exchanged_axes(), 0.937, 0.33);
  ASSERT_TRUE(doubted);
  EXPECT_GT(*doubted->wrong_probability, kPresetLimit);
  EXPECT_EQ(*doubted->mirror_ratio, 0.937);
  EXPECT_EQ(*doubted->mirror_advantage, 0.33);
}

/// Right poses have had 0.97 times the similarity of a mirrored CT, and been better patch by patch.
TEST(DoubtedForMirroredCt, NotIfPatchesAreClearlyBetter) {
  EXPECT_FALSE(doubted_for_mirrored_ct(of_exchanged_axes(), 0.97, 2.8));
}

/// What evidence that is still missing could say at best bounds what it does say.
TEST(IfPartsAgree, NoPoseIsMoreProbablyWrongThanWithItsOwnParts) {
  Measures of_pose = of_exchanged_axes();
  for (const double agreement : {-0.2, 0.3, 0.494, 1.0}) {
    of_pose.local_agreement = agreement;
    const std::optional<double> wrong = wrong_probability(of_pose);
    EXPECT_LE(*if_parts_agree(of_pose).wrong_probability, *wrong) << agreement;
    EXPECT_LE(*if_no_mirror_agrees(of_pose).wrong_probability, *wrong) << agreement;
  }
  EXPECT_FALSE(if_parts_agree({}).wrong_probability);  // no comparison, so no evidence
}

}  // namespace
}  // namespace usct::test
