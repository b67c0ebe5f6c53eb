#include <gtest/gtest.h>

#include <algorithm>

#include "core/registration/registration_cases.h"
#include "registration/attempts/pose_judge.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using registration::Assessment;
using registration::Attempt;
using registration::Candidate;
using registration::Decoy;
using registration::Judged;
using registration::PoseJudge;

/// An attempt on agar whose climbs stay where they begin.
class StayingAttempt {
 public:
  explicit StayingAttempt(RegistrationOptions options)
      : options_(staying(std::move(options))),
        images_(*registration::prepare(input_, run_)),
        attempt_(registration::attempt_on(images_, input_, run_)) {}

  const Attempt& attempt() const { return attempt_; }
  const registration::FieldPoints& field() const { return attempt_.problem.field; }
  Candidate candidate(const Isometry3d& T_us_ct) {
    std::vector<Candidate> one{{T_us_ct, {}}};
    registration::evaluate(images_.deciding(), one, run_);
    return one.front();
  }

 private:
  static RegistrationOptions staying(RegistrationOptions options) {
    options.search.starts.reset();
    options.search.distinct_mm = 0.2;
    for (LevelOptions& level : options.search.levels) level.optimizer.max_evaluations = 1;
    options.refinement.reset();
    return options;
  }
  static const PreparedCt& ct() {
    static const PreparedCt agar(agar_case().ct);
    return agar;
  }

  const RegistrationOptions options_;
  const registration::RegistrationInput input_{agar_case().us, ct(), agar_case().T_us_ct_true,
                                               options_};
  const RegistrationHooks hooks_;
  registration::Run run_{hooks_};
  const registration::ImagePyramid images_;
  const Attempt attempt_;
};

Isometry3d truth_moved_by(const Vector3d& by_mm) {
  return beside_truth(agar_case(), {0, 0, 0}, by_mm);
}

/// Options whose gate asks for evidence, and lets no pose or every one pass.
RegistrationOptions refusing() {
  return quick_options("confidence: {evidence: own, gates: {max_wrong_probability: 0}}");
}
RegistrationOptions accepting() {
  return quick_options("confidence: {evidence: own, gates: {max_wrong_probability: 1}}");
}

/// A judge of poses that are compared with no mirror image, and with rivals alone.
class PoseJudgeWithoutMirrors : public testing::Test {
 protected:
  PoseJudgeWithoutMirrors() { judge_.take_over({}); }
  Judged judged(const Isometry3d& T_us_ct) {
    const Candidate pose = staying_.candidate(T_us_ct);
    return judge_.judged({pose}, judge_.compared({pose}), pose);
  }
  double distance_mm(const Candidate& pose, const Isometry3d& T_us_ct) const {
    return staying_.field().distance_mm(pose.T_us_ct, T_us_ct);
  }

  StayingAttempt staying_{refusing()};
  PoseJudge judge_{staying_.attempt()};
};

/// Blocks that are asked about steps of 1 mm see no farther than that.
TEST(PoseJudge, FollowsWhatBlocksWishForThreeStepsAtMost) {
  RegistrationOptions options = refusing();
  options.confidence.cluster_step_mm = 1.0;
  StayingAttempt staying(options);
  PoseJudge judge(staying.attempt());
  judge.take_over({});
  const Candidate off = staying.candidate(truth_moved_by({3.4, 3.4, 3.4}));
  const Judged refused = judge.judged({off}, judge.compared({off}), off);
  const Judged followed = judge.follow_wished_motion(refused, 1);
  // Each step adds the optimum to which it led.
  EXPECT_EQ(followed.optima.size(), 4U);
  EXPECT_GT(followed.assessment.measures.local_agreement,
            refused.assessment.measures.local_agreement);
  EXPECT_LT(agar_case().error_mm(followed.refined.T_us_ct), agar_case().error_mm(off.T_us_ct));
}

TEST_F(PoseJudgeWithoutMirrors, FollowsAWishOnlyWhereBlocksThenAgreeMore) {
  Judged right = judged(agar_case().T_us_ct_true);
  ASSERT_TRUE(right.failure);
  right.assessment.wished_motion = Isometry3d(Eigen::Translation3d(3.0, -3.0, 2.0));
  const Judged still = judge_.follow_wished_motion(right, 1);
  EXPECT_EQ(still.refined.T_us_ct.matrix(), right.refined.T_us_ct.matrix());
  EXPECT_EQ(still.optima.size(), 1U);
  Judged off = judged(truth_moved_by({3, -3, 2}));
  off.assessment.wished_motion = Isometry3d(Eigen::Translation3d(-3.0, 3.0, -2.0));
  EXPECT_LT(agar_case().error_mm(judge_.follow_wished_motion(off, 1).refined.T_us_ct), 1.0);
}

TEST_F(PoseJudgeWithoutMirrors, LeavesAnAcceptedPoseWhereItIs) {
  Judged off = judged(truth_moved_by({3, -3, 2}));
  off.assessment.wished_motion = Isometry3d(Eigen::Translation3d(-3.0, 3.0, -2.0));
  off.failure.reset();
  EXPECT_EQ(judge_.follow_wished_motion(off, 1).refined.T_us_ct.matrix(),
            off.refined.T_us_ct.matrix());
}

/// The optimum that was refined becomes a rival of the one to which that led.
TEST_F(PoseJudgeWithoutMirrors, TakesTheOptimumToWhichTheRefinementLedForTheBest) {
  const Candidate far = staying_.candidate(truth_moved_by({20, 0, 0}));
  const Candidate right = staying_.candidate(agar_case().T_us_ct_true);
  const Judged led = judge_.judged_where_it_led({far}, judge_.compared({far}), right);
  ASSERT_EQ(led.optima.size(), 2U);
  EXPECT_LT(distance_mm(led.optima[0], right.T_us_ct), 1e-6);
  EXPECT_EQ(led.optima[1].T_us_ct.matrix(), far.T_us_ct.matrix());
  EXPECT_NEAR(led.assessment.measures.rival_ratio.value(), right.value / far.value, 1e-9);
  EXPECT_NEAR(led.assessment.measures.disagreement_mm.value(), 0.0, 1e-6);
}

TEST_F(PoseJudgeWithoutMirrors, KeepsTheOptimumThatItsRefinementHasNotLeft) {
  const Candidate optimum = staying_.candidate(agar_case().T_us_ct_true);
  const Candidate refined = staying_.candidate(truth_moved_by({0.1, 0, 0}));
  const Judged kept = judge_.judged_where_it_led({optimum}, judge_.compared({optimum}), refined);
  ASSERT_EQ(kept.optima.size(), 1U);
  EXPECT_EQ(kept.optima[0].T_us_ct.matrix(), optimum.T_us_ct.matrix());
  EXPECT_NEAR(kept.assessment.measures.disagreement_mm.value(), 0.1, 1e-6);
}

/// Whether one of the poses of a mirror image lies at a pose.
bool is_at(const Decoy& decoy, const Isometry3d& T_us_ct, const registration::FieldPoints& field) {
  return std::any_of(decoy.optima.begin(), decoy.optima.end(), [&](const Candidate& optimum) {
    return field.distance_mm(optimum.T_us_ct, T_us_ct) < 0.5;
  });
}

TEST(PoseJudge, MirrorImagesClimbFromThePoseToWhichTheRefinementLed) {
  StayingAttempt staying(accepting());
  PoseJudge judge(staying.attempt());
  const Candidate far = staying.candidate(truth_moved_by({20, 0, 0}));
  const Candidate led = staying.candidate(truth_moved_by({2, 1, 1}));
  const Assessment compared = judge.compared({far});
  ASSERT_FALSE(judge.decoys().value().empty());
  for (const Decoy& decoy : *judge.decoys())
    EXPECT_FALSE(is_at(decoy, led.T_us_ct, staying.field()));
  judge.judged_where_it_led({far}, compared, led);
  for (const Decoy& decoy : *judge.decoys())
    EXPECT_TRUE(is_at(decoy, led.T_us_ct, staying.field()));
}

TEST(PoseJudge, APoseThatPassesAfterAStepIsComparedBesideAsManyRounds) {
  StayingAttempt staying(accepting());
  PoseJudge judge(staying.attempt());
  const Candidate off = staying.candidate(truth_moved_by({3, -3, 2}));
  Judged refused = judge.judged({off}, judge.compared({off}), off);
  refused.failure = GateFailure{false, "refused"};
  refused.assessment.measures.mirror_ratio.reset();  // that says nothing
  refused.assessment.wished_motion = Isometry3d(Eigen::Translation3d(-3.0, 3.0, -2.0));
  const Judged accepted = judge.follow_wished_motion(refused, 3);
  EXPECT_FALSE(accepted.failure) << accepted.failure->message;
  EXPECT_EQ(judge.decoys().value().front().rounds, 3);
}

/// A pose that stands out from mirror images and rivals.
Assessment outstanding() {
  Assessment compared;
  Measures& m = compared.measures;
  m.displacement_mm = 5.0;
  m.mirror_ratio = m.chance_ratio = m.rival_ratio = 2.0;
  m.mirror_advantage = m.chance_advantage = m.rival_advantage = 5.0;
  return compared;
}

class PartsCouldSave : public testing::Test {
 protected:
  static bool parts_could_save(const Assessment& compared,
                               EvidenceSource source = EvidenceSource::kOwn, double limit = 0.3) {
    RegistrationOptions options = quick_options();
    options.confidence.evidence = source;
    options.confidence.gates.max_wrong_probability = limit;
    StayingAttempt staying(options);
    return PoseJudge(staying.attempt()).parts_could_save(compared);
  }
};

TEST_F(PartsCouldSave, APoseThatStandsOutOrIsNotKnownTo) {
  EXPECT_TRUE(parts_could_save(outstanding()));
  EXPECT_TRUE(parts_could_save({}));
}

TEST_F(PartsCouldSave, NoPoseThatIsNoBetterThanChance) {
  Assessment by_chance = outstanding();
  by_chance.measures.rival_ratio = 0.9;
  by_chance.measures.rival_advantage = -1.0;
  EXPECT_FALSE(parts_could_save(by_chance));
}

/// Another round would find no better one, so that this one is the result.
TEST_F(PartsCouldSave, AMirroredPoseIsTheResultThoughItIsRefused) {
  Assessment mirrored = outstanding();
  mirrored.measures.mirror_ratio = 0.4;
  mirrored.measures.mirror_advantage = -8.0;
  EXPECT_TRUE(parts_could_save(mirrored));
}

/// A pose that passes a lenient gate is accepted, though another round might find a better one.
TEST_F(PartsCouldSave, AnyPoseThatCouldPassTheGate) {
  Assessment by_chance = outstanding();
  by_chance.measures.rival_ratio = 0.9;
  by_chance.measures.rival_advantage = -1.0;
  EXPECT_TRUE(parts_could_save(by_chance, EvidenceSource::kOwn, 1.0));
}

/// The pose passes its gate, but the preset `patient` goes on for any pose that is in doubt.
TEST_F(PartsCouldSave, NoPoseForWhichThePresetPatientGoesOn) {
  Assessment doubtful = outstanding();
  doubtful.measures.mirror_ratio = 1.0;
  doubtful.measures.mirror_advantage = 2.5;
  EXPECT_TRUE(parts_could_save(doubtful, EvidenceSource::kOwn));
  EXPECT_FALSE(parts_could_save(doubtful, EvidenceSource::kOwnFirst));
  EXPECT_TRUE(parts_could_save(outstanding(), EvidenceSource::kOwnFirst));
}

}  // namespace
}  // namespace usct::test
