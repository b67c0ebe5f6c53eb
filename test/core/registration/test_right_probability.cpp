#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/geometry/random_geometry.h"
#include "nan.h"
#include "us_ct_registration/registration/confidence_text.h"
#include "us_ct_registration/registration/gates.h"
#include "us_ct_registration/registration/right_probability.h"

namespace usct::test {
namespace {

/// A measure that counts as evidence, and whether more of it speaks for the pose.
struct Evidence {
  std::optional<double> Measures::*value;
  bool more_is_better;
  double least, most;
};
const std::vector<Evidence>& evidence() {
  static const std::vector<Evidence> all = {
      {&Measures::displacement_mm, false, 0.0, 120.0},
      {&Measures::mirror_ratio, true, 0.1, 5.0},
      {&Measures::mirror_advantage, true, -9.0, 9.0},
      {&Measures::rival_ratio, true, 0.1, 5.0},
      {&Measures::parts_mm, false, 0.01, 40.0},
      {&Measures::local_agreement, true, -0.3, 1.0},
      {&Measures::local_advantage, true, -4.0, 12.0},
      {&Measures::tissue_motion_mm, false, 0.0, 5.2},
      {&Measures::rival_advantage, true, -9.0, 9.0},
  };
  return all;
}

Measures any_measures() {
  Measures measures;
  for (const Evidence& e : evidence()) measures.*e.value = uniform(e.least, e.most);
  return measures;
}

/// Evidence that is not always gathered.
const Evidence kMirrorAgreement{&Measures::mirror_agreement, false, -0.3, 1.0};
const Evidence kRidgeParts{&Measures::ridge_parts_mm, false, 0.01, 40.0};
const Evidence kWideMotion{&Measures::wide_motion_mm, false, 0.0, 5.2};

double odds(double probability) { return probability / (1.0 - probability); }

/// The most that standing out from chance counts for beside the anatomy: odds of e.
const double kMostOddsOfChance = std::exp(1.0);

RC_GTEST_PROP(RightProbability, MultipliesTheOddsOfChanceAndAnatomyByTheProbabilityOfMirrors, ()) {
  const RightProbability right = right_probability(any_measures()).value();
  for (const double each : {right.mirrors, right.chance, right.anatomy, right.all()})
    RC_ASSERT(each >= 0.0 && each <= 1.0);
  const double both = std::min(odds(right.chance), kMostOddsOfChance) * odds(right.anatomy);
  RC_ASSERT(std::abs(right.all() - right.mirrors * both / (1.0 + both)) < 1e-9);
}

RC_GTEST_PROP(RightProbability, BetterEvidenceNeverLowersIt, (bool with_all)) {
  Measures measures = any_measures();
  std::vector<Evidence> gathered = evidence();
  if (with_all) {
    for (const Evidence& e : {kMirrorAgreement, kRidgeParts, kWideMotion}) {
      gathered.push_back(e);
      measures.*e.value = uniform(e.least, e.most);
    }
  }
  const RightProbability before = right_probability(measures).value();
  for (const Evidence& e : gathered) {
    Measures better = measures;
    double& value = *(better.*e.value);
    value = e.more_is_better ? uniform(value, e.most) : uniform(e.least, value);
    const RightProbability after = right_probability(better).value();
    constexpr double kRounding = 1e-12;
    RC_ASSERT(after.mirrors >= before.mirrors - kRounding);
    RC_ASSERT(after.chance >= before.chance - kRounding);
    RC_ASSERT(after.anatomy >= before.anatomy - kRounding);
  }
}

/// Strong evidence of every kind.
Measures strong_measures() {
  Measures measures;
  measures.displacement_mm = measures.parts_mm = 0.0;
  measures.mirror_ratio = measures.rival_ratio = measures.chance_ratio = 2.0;
  measures.mirror_advantage = measures.rival_advantage = 5.0;
  measures.local_agreement = 0.5;
  measures.local_advantage = 8.0;
  measures.tissue_motion_mm = 1.0;
  return measures;
}

/// The kidney of another patient, laid on this one: it stands out from chance and from mirror
/// images, but its blocks do not agree.
TEST(RightProbability, NothingMakesUpForBlocksThatDoNotAgree) {
  Measures measures = strong_measures();
  measures.mirror_ratio = measures.rival_ratio = 100.0;
  measures.mirror_advantage = measures.rival_advantage = 100.0;
  measures.local_agreement = 0.2;
  EXPECT_LT(right_probability(measures)->all(), 0.5);
  EXPECT_GT(right_probability(measures)->chance, 0.95);
  measures.local_agreement = 0.4;
  EXPECT_GT(right_probability(measures)->all(), 0.9);
}

/// The right pose in a CT of low contrast, as it was measured: noise lets its blocks agree little,
/// and those of its mirror images hardly at all.
TEST(RightProbability, BlocksThatAgreeLittleButMoreThanThoseOfMirrorImagesSpeakForThePose) {
  Measures measures = strong_measures();
  measures.mirror_ratio = 4.12;
  measures.mirror_advantage = 7.14;
  measures.rival_ratio = 3.34;
  measures.local_agreement = 0.16;
  measures.local_advantage = 5.0;
  measures.tissue_motion_mm = 1.62;
  EXPECT_LT(right_probability(measures)->all(), 0.5);
  measures.mirror_agreement = 0.01;
  EXPECT_GT(right_probability(measures)->all(), 0.9);
  measures.mirror_agreement = 0.15;
  EXPECT_LT(right_probability(measures)->all(), 0.5);
  // Blocks of another patient's kidney gain little together and would rather lie elsewhere.
  measures.mirror_agreement = 0.01;
  measures.local_advantage = 3.0;
  measures.tissue_motion_mm = 3.8;
  EXPECT_LT(right_probability(measures)->all(), 0.1);
}

/// Many blocks that agree by as little as chance lets few agree are sure together. Both poses were
/// measured: one in a kidney of a real CT, found to 0.4 mm while the patient breathed during the
/// sweep, and the kidney of another patient, who is much alike.
TEST(RightProbability, ManyBlocksAreSureTogetherWhereThoseOfMirrorImagesDoNotAgree) {
  Measures breathing = strong_measures();
  breathing.mirror_ratio = 4.98;
  breathing.mirror_advantage = 7.35;
  breathing.rival_ratio = 4.33;
  breathing.rival_advantage = 6.7;
  breathing.local_agreement = 0.12;
  breathing.mirror_agreement = 0.03;
  breathing.tissue_motion_mm = 2.32;
  breathing.local_advantage = 6.7;
  EXPECT_GT(right_probability(breathing)->all(), 0.8);
  breathing.local_advantage = 3.0;
  EXPECT_LT(right_probability(breathing)->all(), 0.5);
  Measures another = strong_measures();
  another.mirror_ratio = 1.62;
  another.mirror_advantage = 6.78;
  another.rival_ratio = 1.72;
  another.rival_advantage = 6.81;
  another.parts_mm = 1.63;
  another.local_agreement = 0.28;
  another.mirror_agreement = 0.13;
  another.tissue_motion_mm = 3.1;
  another.local_advantage = 7.1;
  EXPECT_LT(right_probability(another)->all(), 0.5);
}

/// An optimum of the right CT, 10 mm off, as it was measured: the blocks around the kidney are sure
/// together, but tissue in the middle would rather lie elsewhere.
TEST(RightProbability, SureBlocksDoNotMakeUpForTissueThatWouldRatherLieElsewhere) {
  Measures off = strong_measures();
  off.mirror_ratio = 2.44;
  off.mirror_advantage = 3.52;
  off.rival_ratio = 1.91;
  off.rival_advantage = 3.29;
  off.local_agreement = 0.12;
  off.mirror_agreement = 0.03;
  off.local_advantage = 6.9;
  off.tissue_motion_mm = 3.33;
  EXPECT_LT(right_probability(off)->all(), 0.7);
  off.tissue_motion_mm = 2.0;
  EXPECT_GT(right_probability(off)->all(), 0.8);
}

/// The right pose of a kidney with a low contrast, as it was measured: noise moves small groups of
/// blocks, and wide ones hardly. Where tissue has moved, both are.
TEST(RightProbability, NoiseOfSmallGroupsOfBlocksIsNoMotionOfTissue) {
  Measures noisy = strong_measures();
  noisy.mirror_ratio = 1.07;
  noisy.mirror_advantage = 3.49;
  noisy.rival_ratio = 1.15;
  noisy.local_agreement = 0.06;
  noisy.mirror_agreement = 0.03;
  noisy.local_advantage = 6.54;
  noisy.tissue_motion_mm = 2.55;
  EXPECT_LT(right_probability(noisy)->all(), 0.5);
  noisy.wide_motion_mm = 2.6;
  EXPECT_LT(right_probability(noisy)->all(), 0.5);
  noisy.wide_motion_mm = 1.0;
  EXPECT_GT(right_probability(noisy)->all(), 0.7);
  // In a small field wide groups of few blocks lie still in the kidney of another patient.
  Measures another = noisy;
  another.local_agreement = 0.22;
  another.mirror_agreement = 0.05;
  another.local_advantage = 4.72;
  another.tissue_motion_mm = 3.17;
  another.wide_motion_mm = 0.92;
  EXPECT_LT(right_probability(another)->all(), 0.5);
}

/// Another optimum of the right CT, 10 mm off: halves of the field agree about it by one of their
/// similarities only.
TEST(RightProbability, HalvesMustAgreeByBothOfTheirSimilarities) {
  Measures off = strong_measures();
  off.mirror_ratio = 1.54;
  off.mirror_advantage = 7.47;
  off.rival_ratio = 1.93;
  off.rival_advantage = 4.77;
  off.local_agreement = 0.09;
  off.mirror_agreement = 0.01;
  off.local_advantage = 4.13;
  off.tissue_motion_mm = 2.37;
  off.parts_mm = 0.07;
  off.ridge_parts_mm = 0.9;
  EXPECT_GT(right_probability(off)->all(), 0.7);
  off.ridge_parts_mm = 7.28;
  EXPECT_LT(right_probability(off)->all(), 0.1);
}

/// Nothing makes up for halves that move a pose by far; by how far then says no more.
TEST(RightProbability, HalvesThatMoveAPoseVeryFarLeaveItImprobable) {
  for (const auto halves : {&Measures::parts_mm, &Measures::ridge_parts_mm}) {
    const auto anatomy = [&](double moved_mm) {
      Measures torn = strong_measures();
      torn.local_agreement = 0.9;
      torn.*halves = moved_mm;
      return right_probability(torn)->anatomy;
    };
    EXPECT_GT(anatomy(4.0), 0.9);
    EXPECT_LT(anatomy(20.0), 0.01);
    EXPECT_LT(anatomy(7.9), anatomy(7.0));
    EXPECT_EQ(anatomy(8.1), anatomy(20.0));
  }
}

/// Of two poses whose blocks agree equally well, that one is right whose tissue need not have moved
/// and which stands out from its mirror images.
TEST(RightProbability, BlocksThatAgreeHalfwayNeedOtherEvidence) {
  Measures noisy = strong_measures();
  noisy.local_agreement = 0.29;
  EXPECT_GT(right_probability(noisy)->all(), 0.8);
  Measures of_another_patient = noisy;
  of_another_patient.tissue_motion_mm = 3.3;
  of_another_patient.mirror_ratio = 1.2;
  of_another_patient.mirror_advantage = 4.0;
  EXPECT_LT(right_probability(of_another_patient)->all(), 0.3);
}

/// A nearly symmetric kidney fits its mirror image almost as well, but the blocks of the field
/// agree less with each other there. If they agree more, the mirror image is the right one.
TEST(RightProbability, AgreementOfMirrorImagesTellsSymmetricKidneysApart) {
  Measures symmetric = strong_measures();
  symmetric.mirror_ratio = 1.0;
  symmetric.mirror_advantage = 0.8;
  const double without = right_probability(symmetric)->mirrors;
  EXPECT_GT(without, 0.3);
  EXPECT_LT(without, 0.7);
  symmetric.mirror_agreement = *symmetric.local_agreement - 0.15;
  EXPECT_GT(right_probability(symmetric)->mirrors, 0.9);
  EXPECT_GT(right_probability(symmetric)->all(), 0.8);
  symmetric.mirror_agreement = *symmetric.local_agreement + 0.15;
  EXPECT_LT(right_probability(symmetric)->all(), 0.1);
}

/// The square of an error's length over its variance along an axis is chi-squared with 3 degrees of
/// freedom, of which 7.815 is the 95 % quantile.
TEST(RightProbability, AnErrorThatMayExceedFiveMillimetresIsAFactor) {
  Measures measures = strong_measures();
  const double without = right_probability(measures)->all();
  measures.expected_error_mm = 5.0 * std::sqrt(3.0 / 7.815);
  EXPECT_NEAR(right_probability(measures)->all(), 0.95 * without, 1e-4);
  measures.expected_error_mm = 0.0;
  EXPECT_NEAR(right_probability(measures)->all(), without, 1e-12);
  measures.expected_error_mm = kNan;
  EXPECT_FALSE(right_probability(measures));
}

/// A small error is no evidence for a pose that is refused for something else.
TEST(EvidenceText, NamesTheSizeOfTheErrorOnlyIfItMayBeTooLarge) {
  Measures measures = strong_measures();
  measures.expected_error_mm = 1.0;
  EXPECT_EQ(evidence_text(measures).find("error"), std::string::npos) << evidence_text(measures);
  measures.expected_error_mm = 4.7;
  EXPECT_NE(evidence_text(measures).find("its error is about 4.7 mm"), std::string::npos)
      << evidence_text(measures);
}

TEST(EvidenceText, SaysHowFarMirrorImagesAgreeIfTheyWereAsked) {
  Measures measures = strong_measures();
  EXPECT_EQ(evidence_text(measures).find("a mirror image by"), std::string::npos);
  measures.mirror_agreement = 0.23;
  EXPECT_NE(evidence_text(measures).find("by 0.50, and with a mirror image by 0.23 at most"),
            std::string::npos)
      << evidence_text(measures);
}

RegistrationResult found_pose(bool is_accepted) {
  RegistrationResult result;
  result.candidates.resize(1);
  if (is_accepted) result.T_us_ct = Eigen::Isometry3d::Identity();
  result.measures = strong_measures();
  result.measures.wrong_probability = 0.06;
  result.measures.expected_error_mm = 2.5;
  result.measures.error_bound_mm = 4.0;
  return result;
}
const std::string kProbability = "probability that the pose is more than 5 mm off: 0.060\n";

TEST(ConfidenceText, TellsTheExpectedErrorAndItsBoundAsFarAsTheyAreKnown) {
  RegistrationResult result = found_pose(true);
  const std::string error = "expected error in the middle of the field: 2.50 mm";
  EXPECT_EQ(confidence_text(result),
            kProbability + error + "; below 4.00 mm in 90 of 100 registrations that are right\n");
  result.measures.error_bound_mm.reset();
  EXPECT_EQ(confidence_text(result), kProbability + error + "\n");
  result.measures.expected_error_mm.reset();
  EXPECT_EQ(confidence_text(result), kProbability + "expected error: not known\n");
  result.measures.wrong_probability.reset();
  EXPECT_EQ(confidence_text(result),
            "probability that the pose is more than 5 mm off: not known\n"
            "expected error: not known\n");
}

TEST(ConfidenceText, OfARefusedPoseGivesTheEvidenceInPlaceOfTheError) {
  const RegistrationResult result = found_pose(false);
  EXPECT_EQ(confidence_text(result), kProbability + evidence_text(result.measures));
  EXPECT_EQ(confidence_text({}), "");
}

/// Measures between good and bad, where each of them matters.
Measures middling() {
  Measures measures;
  measures.displacement_mm = 50.0;
  measures.mirror_ratio = measures.rival_ratio = 1.4;
  measures.mirror_advantage = 1.0;
  measures.rival_advantage = 3.0;
  measures.parts_mm = 5.0;
  measures.local_agreement = 0.26;
  measures.local_advantage = 4.0;
  measures.tissue_motion_mm = 1.0;
  return measures;
}

/// The same, where mirror images were asked and blocks agree little.
Measures middling_of_many_blocks() {
  Measures measures = middling();
  measures.mirror_agreement = 0.02;
  measures.local_agreement = 0.12;
  measures.local_advantage = 6.0;
  measures.tissue_motion_mm = 2.0;
  return measures;
}

bool counts_in(const Measures& measures, const Evidence& e) {
  Measures better = measures;
  *(better.*e.value) *= e.more_is_better ? 1.1 : 0.9;
  return right_probability(better)->all() > right_probability(measures)->all();
}

/// What many blocks gain together counts once mirror images were asked.
TEST(RightProbability, EveryMeasureCounts) {
  EXPECT_TRUE(counts_in(middling_of_many_blocks(), kMirrorAgreement));
  for (const Evidence& e : evidence()) {
    const bool of_many_blocks = e.value == &Measures::local_advantage;
    EXPECT_TRUE(counts_in(of_many_blocks ? middling_of_many_blocks() : middling(), e));
  }
}

TEST(RightProbability, NothingFollowsFromEvidenceThatIsAbsentOrNoNumber) {
  ASSERT_TRUE(right_probability(middling()));
  for (const Evidence& e : evidence())
    for (const std::optional<double>& value : {std::optional<double>(), std::optional(kNan)}) {
      Measures measures = middling();
      measures.*e.value = value;
      EXPECT_FALSE(right_probability(measures));
    }
  Measures measures = middling();
  measures.mirror_agreement = kNan;
  EXPECT_FALSE(right_probability(measures));
  measures = middling();
  measures.ridge_parts_mm = kNan;
  EXPECT_FALSE(right_probability(measures));
  EXPECT_FALSE(right_probability({}));
}

/// The words must not name a cause that is not there: without the gate on it, no evidence is
/// gathered for a pose that may be right.
TEST(RightProbability, WordsSayWhichEvidenceIsMissing) {
  EXPECT_EQ(missing_evidence(middling()), "");
  Measures none;
  none.overlap = 0.9;
  none.displacement_mm = 3.0;
  EXPECT_EQ(missing_evidence(none), "none was gathered");
  EXPECT_EQ(evidence_text(none), "evidence: none was gathered\n");
  for (const std::optional<double>& value : {std::optional<double>(), std::optional(kNan)}) {
    Measures some = middling();
    some.parts_mm = value;
    EXPECT_EQ(missing_evidence(some).find("parts_mm could not be measured"), 0U);
    EXPECT_NE(evidence_text(some).find("parts_mm"), std::string::npos);
  }
  Measures measures = middling();
  measures.wide_motion_mm = kNan;
  EXPECT_EQ(missing_evidence(measures).find("wide_motion_mm "), 0U);
}

TEST(RightProbability, OtherMeasuresAreNoEvidence) {
  Measures measures = middling();
  const double before = right_probability(measures)->all();
  measures.overlap = 0.0;
  measures.deformation_mm = 9.0;
  measures.disagreement_mm = 30.0;
  measures.depth_error = kNan;
  EXPECT_EQ(right_probability(measures)->all(), before);
}

/// Nothing says that a trend goes on where the calibration has seen nothing.
TEST(RightProbability, WhatLiesFarBeyondTheCalibrationCountsNoMore) {
  struct Far {
    std::optional<double> Measures::*value;
    double far, farther;
  };
  Measures moved = middling_of_many_blocks();  // far from sure, whatever its blocks gain
  moved.tissue_motion_mm = 4.0;
  for (const Far& e : {Far{&Measures::mirror_ratio, 10.0, 1000.0},
                       {&Measures::mirror_ratio, 0.1, 0.001},
                       {&Measures::mirror_advantage, 50.0, 500.0},
                       {&Measures::mirror_advantage, -50.0, -500.0},
                       {&Measures::rival_ratio, 10.0, 1000.0},
                       {&Measures::rival_ratio, 0.1, 0.001},
                       {&Measures::rival_advantage, 50.0, 500.0},
                       {&Measures::local_advantage, 50.0, 500.0},
                       {&Measures::local_advantage, -50.0, -500.0},
                       {&Measures::parts_mm, 20.0, 200.0}})
    for (Measures measures : {middling(), middling_of_many_blocks(), moved}) {
      measures.*e.value = e.far;
      const RightProbability far = right_probability(measures).value();
      measures.*e.value = e.farther;
      const RightProbability farther = right_probability(measures).value();
      EXPECT_EQ(far.mirrors, farther.mirrors) << e.farther;
      EXPECT_EQ(far.chance, farther.chance) << e.farther;
      EXPECT_EQ(far.anatomy, farther.anatomy) << e.farther;
    }
}

/// A pose that fits far better than its mirror images is not mirrored, even if blocks agree with
/// those as much.
TEST(RightProbability, AgreementOfMirrorImagesTakesNothingFromAClearlyBetterFit) {
  Measures measures = strong_measures();
  const double before = right_probability(measures)->mirrors;
  EXPECT_GT(before, 0.99);
  measures.mirror_agreement = measures.local_agreement;
  EXPECT_EQ(right_probability(measures)->mirrors, before);
}

/// Wide groups see 0.4 mm less of a motion of tissue than small ones.
TEST(RightProbability, WideGroupsMustLieClearlyStillerThanSmallOnes) {
  Measures measures = middling_of_many_blocks();
  const double by_small = right_probability(measures)->anatomy;
  measures.wide_motion_mm = *measures.tissue_motion_mm - 0.3;
  EXPECT_EQ(right_probability(measures)->anatomy, by_small);
  measures.wide_motion_mm = *measures.tissue_motion_mm - 0.5;
  EXPECT_GT(right_probability(measures)->anatomy, by_small);
}

/// Blocks that agree by no more than chance gives show no anatomy, however little those of mirror
/// images do.
TEST(RightProbability, MoreThanMirrorImagesIsNothingWhereBlocksHardlyAgree) {
  Measures measures = middling_of_many_blocks();
  measures.local_agreement = 0.01;
  measures.mirror_agreement = 0.0;
  EXPECT_LT(right_probability(measures)->anatomy, 0.1);
}

/// Whether the gates accept measures of this evidence.
bool is_accepted(Measures measures) {
  measures.overlap = 1.0;
  measures.wrong_probability = 1.0 - right_probability(measures)->all();
  return !judge(measures, {});
}

/// Strong evidence of one kind does not make up for weak evidence of another.
TEST(RightProbability, EachKindRefusesAlone) {
  Measures strong = middling();
  strong.mirror_ratio = strong.rival_ratio = 5.0;
  strong.mirror_advantage = strong.rival_advantage = 9.0;
  strong.parts_mm = 0.1;
  strong.local_agreement = 0.9;
  strong.local_advantage = 9.0;
  strong.tissue_motion_mm = 0.0;
  strong.displacement_mm = 0.0;
  EXPECT_TRUE(is_accepted(strong));
  Measures mirrored = strong;
  mirrored.mirror_ratio = 0.8;
  mirrored.mirror_advantage = -3.0;
  EXPECT_FALSE(is_accepted(mirrored));
  Measures by_chance = strong;
  by_chance.rival_ratio = 1.0;
  by_chance.rival_advantage = 0.5;
  EXPECT_FALSE(is_accepted(by_chance));
  for (const auto halves : {&Measures::parts_mm, &Measures::ridge_parts_mm}) {
    Measures torn = strong;
    torn.*halves = 10.0;
    EXPECT_FALSE(is_accepted(torn));
  }
  Measures of_another_patient = strong;
  of_another_patient.local_agreement = 0.15;
  EXPECT_FALSE(is_accepted(of_another_patient));
}

/// Distance counts only where the other evidence is not strong.
TEST(RightProbability, AFarPoseNeedsStrongerEvidence) {
  Measures measures = middling();
  measures.displacement_mm = 10.0;
  const double near = right_probability(measures)->all();
  measures.displacement_mm = 80.0;
  EXPECT_LT(right_probability(measures)->all(), 0.5 * near);
  measures.mirror_ratio = measures.rival_ratio = 3.0;
  measures.mirror_advantage = measures.rival_advantage = 6.0;
  measures.parts_mm = 0.5;
  measures.local_agreement = 0.6;
  EXPECT_GT(right_probability(measures)->all(), 0.9);
}

}  // namespace
}  // namespace usct::test
