#include <gtest/gtest.h>

#include "registration/attempts/verdict.h"
#include "registration/evidence/doubts.h"

namespace usct::test {
namespace {

using registration::Assessment;
using registration::Candidate;
using registration::fits_mirrored;
using registration::Judged;
using registration::may_be_missed;
using registration::Refusal;
using registration::result_of;

/// Evidence that speaks for the pose in every way.
Assessment strong() {
  Assessment assessment;
  Measures& m = assessment.measures;
  m.overlap = 0.9;
  m.displacement_mm = 5.0;
  m.disagreement_mm = 0.5;
  m.mirror_ratio = m.chance_ratio = m.rival_ratio = 2.0;
  m.mirror_advantage = m.chance_advantage = m.rival_advantage = 5.0;
  m.parts_mm = m.ridge_parts_mm = 0.5;
  m.local_agreement = 0.6;
  m.local_advantage = 9.0;
  m.tissue_motion_mm = 0.8;
  assessment.best_mirror = Mirror::kLines;
  return assessment;
}

Assessment mirrored(Mirror mirror, double ratio, double advantage) {
  Assessment assessment = strong();
  assessment.best_mirror = mirror;
  assessment.measures.mirror_ratio = ratio;
  assessment.measures.mirror_advantage = advantage;
  return assessment;
}

Assessment by_chance(double chance_ratio, double rival_ratio) {
  Assessment assessment = strong();
  assessment.measures.chance_ratio = chance_ratio;
  assessment.measures.rival_ratio = rival_ratio;
  assessment.measures.rival_advantage = 0.5;
  return assessment;
}

Assessment torn() {
  Assessment assessment = strong();
  assessment.measures.parts_mm = 7.0;
  assessment.measures.ridge_parts_mm = 9.0;
  assessment.measures.local_agreement = 0.12;
  assessment.measures.local_advantage = 3.0;
  assessment.measures.tissue_motion_mm = 3.2;
  return assessment;
}

std::vector<Candidate> two_optima() {
  std::vector<Candidate> optima(2);
  optima[0].value = 0.4;
  optima[0].overlap = 0.9;
  optima[1].value = 0.3;
  optima[1].T_us_ct.translation().x() = 30.0;
  return optima;
}

Candidate refined() {
  Candidate pose;
  pose.T_us_ct.translation().y() = 0.5;
  pose.overlap = 0.8;
  return pose;
}

/// The result of a pose that fails the gate of the evidence.
RegistrationResult refused(const Assessment& assessment) {
  return result_of(Judged{two_optima(), refined(), assessment, GateFailure{false, "the reason"}});
}

void expect_named(const Assessment& assessment, const std::vector<std::string>& named) {
  const RegistrationResult result = refused(assessment);
  EXPECT_EQ(result.status, RegistrationStatus::kLowConfidence);
  EXPECT_FALSE(result.T_us_ct);
  EXPECT_EQ(result.message.find("the reason"), 0U) << result.message;
  for (const std::string& part : named)
    EXPECT_NE(result.message.find(part), std::string::npos) << part << "\n" << result.message;
}

TEST(Verdict, AMirroredUltrasoundThatFitsBetterIsNamed) {
  expect_named(mirrored(Mirror::kLines, 0.8, -2.0),
               {"better with its lines in reverse order", "1.2 times", "file"});
  expect_named(mirrored(Mirror::kFrames, 0.8, -2.0), {"better with its frames in reverse order"});
  expect_named(mirrored(Mirror::kHalfTurn, 0.8, -2.0),
               {"better with the probe turned by half a turn"});
  expect_named(mirrored(Mirror::kCtAxis1, 0.8, -2.0),
               {"better with the first axis of the CT reversed", "CT's file"});
  expect_named(mirrored(Mirror::kCtAxis2, 0.8, -2.0), {"the second axis of the CT reversed"});
  expect_named(mirrored(Mirror::kCtAxis3, 0.8, -2.0), {"the third axis of the CT reversed"});
  expect_named(mirrored(Mirror::kCtAxes12, 0.8, -2.0),
               {"better with the first and second axes of the CT exchanged", "CT's file"});
  expect_named(mirrored(Mirror::kCtAxes13, 0.8, -2.0), {"the first and third axes of the CT"});
  expect_named(mirrored(Mirror::kCtAxes23, 0.8, -2.0), {"the second and third axes of the CT"});
}

/// Without an advantage in most of the field the mirrored ultrasound is not said to be right.
TEST(Verdict, AnAnatomyThatIsNearlySymmetricIsNotCalledMirrored) {
  for (const Assessment& assessment :
       {mirrored(Mirror::kFrames, 1.02, -2.0), mirrored(Mirror::kFrames, 0.95, 0.2)})
    expect_named(assessment, {"about as well with its frames in reverse order", "symmetric"});
}

TEST(Verdict, ARivalIsToldFromChance) {
  expect_named(by_chance(1.5, 1.02), {"a pose elsewhere", "1 times", "initial pose"});
  expect_named(by_chance(1.05, 1.05), {"chance", "1.1 times", "another patient"});
}

TEST(Verdict, AnAnatomyThatMayBeAnotherIsNamedWithWhatSpeaksAgainstIt) {
  expect_named(torn(), {"another anatomy", "by 0.12", "lie 3.2 mm elsewhere",
                        "move the pose by 9 mm", "2 times", "another patient"});
}

TEST(Verdict, AnErrorThatMayBeTooLargeIsNamedWithTheMotionOfTissue) {
  Assessment assessment = strong();
  assessment.measures.expected_error_mm = 6.0;
  assessment.measures.tissue_motion_mm = 4.1;
  expect_named(assessment, {"expected are 6 mm", "lie 4.1 mm elsewhere", "breath hold"});
}

TEST(Verdict, AFaultOfTheRecordedGeometryIsNamedForEveryPose) {
  Assessment assessment = strong();
  const auto message = [&] {
    return result_of(Judged{two_optima(), refined(), assessment, std::nullopt}).message;
  };
  assessment.measures.depth_error = -0.015;
  assessment.measures.sweep_error = 0.04;
  assessment.measures.errors_ratio = 1.1;
  assessment.measures.errors_advantage = 5.0;
  EXPECT_EQ(message(), "all gates passed");
  assessment.measures.depth_error = -0.06;
  EXPECT_NE(message().find("depths are 6 % smaller"), std::string::npos) << message();
  EXPECT_EQ(message().find("frames"), std::string::npos) << message();
  assessment.measures.sweep_error = 0.12;
  EXPECT_NE(message().find("12 % farther apart"), std::string::npos) << message();
  // Noise may make errors that the images do not show.
  for (std::optional<double> Measures::*measure :
       {&Measures::errors_ratio, &Measures::errors_advantage}) {
    const std::optional<double> shown = assessment.measures.*measure;
    for (const std::optional<double>& weak : {std::optional(1.01), std::optional<double>()}) {
      assessment.measures.*measure = weak;
      EXPECT_EQ(message(), "all gates passed");
    }
    assessment.measures.*measure = shown;
  }
  assessment = torn();
  assessment.measures.depth_error = 0.07;
  assessment.measures.errors_ratio = 1.1;
  assessment.measures.errors_advantage = 5.0;
  expect_named(assessment, {"depths are 7 % larger", "probe file"});
  assessment = strong();
  assessment.measures.depth_error = 0.07;
  assessment.measures.errors_ratio = 1.1;
  assessment.measures.errors_advantage = 5.0;
  assessment.measures.expected_error_mm = 6.0;
  expect_named(assessment,
               {"expected are 6 mm), since the recorded depths are wrong; the ultrasound "
                "fits better if its depths are 7 % larger"});
}

/// The unevenness is added after the middle frame, and taken off before it.
TEST(Verdict, ASweepThatIsWrongOnOneSideIsNamedWithThatSide) {
  Assessment assessment = strong();
  assessment.measures.errors_ratio = 1.1;
  assessment.measures.errors_advantage = 5.0;
  assessment.measures.depth_error = 0.0;
  const auto message = [&](double sweep, double unevenness) {
    assessment.measures.sweep_error = sweep;
    assessment.measures.sweep_unevenness = unevenness;
    return result_of(Judged{two_optima(), refined(), assessment, std::nullopt}).message;
  };
  const auto expect_words = [](const std::string& found, const std::string& words) {
    EXPECT_NE(found.find("its frames lie " + words + ": check the motor's step"), std::string::npos)
        << found;
  };
  expect_words(message(0.10, 0.04),
               "6 % farther apart before the middle of the sweep and 14 % farther apart after it");
  expect_words(
      message(0.02, -0.08),
      "10 % farther apart before the middle of the sweep and 6 % closer together after it");
  expect_words(message(-0.1, 0.01), "10 % closer together");
}

/// A sweep that was corrected by 8 % and still looks 1 % too short is 9 % too short as recorded.
TEST(Verdict, ACorrectedSweepIsToldWithWhatIsLeft) {
  RegistrationResult result;
  result.message = "all gates passed";
  registration::tell_corrected_sweep({}, result);
  EXPECT_EQ(result.message, "all gates passed");
  EXPECT_FALSE(result.measures.sweep_error || result.measures.sweep_unevenness);
  result.measures.sweep_error = 0.01;
  registration::tell_corrected_sweep({0.0, 0.08, -0.05}, result);
  EXPECT_NEAR(*result.measures.sweep_error, 0.09, 1e-12);
  EXPECT_NEAR(*result.measures.sweep_unevenness, -0.05, 1e-12);
  EXPECT_NE(result.message.find("the frames were taken to lie 13 % farther apart before the middle "
                                "of the sweep and 3 % farther apart after it"),
            std::string::npos)
      << result.message;
}

TEST(Verdict, TheWeakestEvidenceGivesTheReason) {
  Assessment assessment = mirrored(Mirror::kLines, 0.7, -9.0);
  assessment.measures.local_agreement = 0.3;
  expect_named(assessment, {"lines in reverse order"});
}

TEST(Verdict, WithoutEvidenceItSaysSo) {
  expect_named({}, {"no evidence"});
  Assessment assessment = strong();
  assessment.measures.parts_mm.reset();
  expect_named(assessment, {"no evidence"});
}

TEST(Verdict, TooLittleOverlapNeedsNoFurtherReason) {
  const RegistrationResult result =
      result_of(Judged{two_optima(), refined(), torn(), GateFailure{true, "the reason"}});
  EXPECT_EQ(result.status, RegistrationStatus::kNoOverlap);
  EXPECT_EQ(result.message, "the reason");
}

/// The pose that was judged comes first, accepted or not, and only an accepted one is a transform.
TEST(Verdict, ResultsListThePoseThatWasJudgedAndTheOtherOptima) {
  const std::vector<Candidate> optima = two_optima();
  Assessment assessment = strong();
  assessment.covariance = 0.25 * Eigen::Matrix<double, 6, 6>::Identity();
  const RegistrationResult accepted =
      result_of(Judged{optima, refined(), assessment, std::nullopt});
  EXPECT_EQ(accepted.covariance, assessment.covariance);
  EXPECT_EQ(accepted.status, RegistrationStatus::kRegistered);
  ASSERT_TRUE(accepted.T_us_ct);
  EXPECT_EQ(accepted.T_us_ct->matrix(), refined().T_us_ct.matrix());
  for (const RegistrationResult& result : {accepted, refused(torn())}) {
    EXPECT_EQ(result.similarity, 0.4);
    EXPECT_EQ(result.overlap, 0.8);
    ASSERT_EQ(result.candidates.size(), 2U);
    EXPECT_EQ(result.candidates[0].T_us_ct.matrix(), refined().T_us_ct.matrix());
    EXPECT_EQ(result.candidates[0].similarity, 0.4);
    EXPECT_EQ(result.candidates[1].T_us_ct.matrix(), optima[1].T_us_ct.matrix());
    EXPECT_EQ(result.candidates[1].similarity, 0.3);
  }
}

TEST(Verdict, AStepThatCannotGoOnGivesItsStatusAndMessage) {
  const RegistrationResult result =
      result_of(Refusal{RegistrationStatus::kNoOverlap, "the CT is elsewhere"});
  EXPECT_EQ(result.status, RegistrationStatus::kNoOverlap);
  EXPECT_EQ(result.message, "the CT is elsewhere");
  EXPECT_FALSE(result.T_us_ct);
}

TEST(FitsMirrored, WhereItDoesSoFarBetterAndSurely) {
  EXPECT_TRUE(fits_mirrored(mirrored(Mirror::kLines, 0.5, -4.5).measures));
  EXPECT_FALSE(fits_mirrored(mirrored(Mirror::kLines, 0.7, -4.5).measures));
  EXPECT_FALSE(fits_mirrored(mirrored(Mirror::kLines, 0.5, -3.5).measures));
  EXPECT_FALSE(fits_mirrored(strong().measures));
  EXPECT_FALSE(fits_mirrored({}));
}

/// Another round is of use only where the pose is no better than chance, or no firmer than a wrong
/// one.
TEST(MayBeMissed, WhereThePoseDoesNotStandOut) {
  EXPECT_FALSE(may_be_missed(strong().measures));
  EXPECT_FALSE(may_be_missed(mirrored(Mirror::kLines, 0.7, -5.0).measures));
  EXPECT_TRUE(may_be_missed(torn().measures));
  EXPECT_TRUE(may_be_missed(by_chance(1.0, 1.0).measures));
  EXPECT_TRUE(may_be_missed(by_chance(1.3, 1.0).measures));
  EXPECT_TRUE(may_be_missed({}));
  // Mirrored ultrasound is the right one: no more starts are needed to know.
  Assessment wrong_way_round = mirrored(Mirror::kLines, 0.2, -12.0);
  wrong_way_round.measures.chance_ratio = 0.4;
  EXPECT_FALSE(may_be_missed(wrong_way_round.measures));
}

}  // namespace
}  // namespace usct::test
