#include <gtest/gtest.h>

#include <atomic>

#include "core/registration/analytic_similarity.h"
#include "core/registration/registration_cases.h"
#include "registration/attempts/judged_as_patient.h"
#include "us_ct_registration/registration/right_probability.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using registration::FieldPoints;

/// Counts the poses that it is asked for.
class Counting final : public Similarity {
 public:
  explicit Counting(const Similarity& similarity) : similarity_(similarity) {}
  using Similarity::evaluate;
  void evaluate(const SimilarityPose* poses, std::size_t count, SimilarityValue* values,
                const Check& check) const override {
    asked += static_cast<int>(count);
    similarity_.evaluate(poses, count, values, check);
  }
  mutable std::atomic<int> asked{0};

 private:
  const Similarity& similarity_;
};

/// What is made of agar where the own search knows nothing but a peak, far from the truth.
struct JudgedPeak {
  Isometry3d T_us_ct_initial;
  Isometry3d T_us_ct_peak;
  FieldPoints field;
  int starts = 0;
  int own_evaluations = 0;
  int evaluations = 0;
  RegistrationResult result;
};

constexpr int kStarts = 64;

JudgedPeak judged(int rounds, const Isometry3d& T_us_ct_peak, double limit = 0.3,
                  int refining = 12) {
  JudgedPeak made;
  made.T_us_ct_initial = beside_truth(agar_case(), {0, 0, 0}, {15, 0, 5});
  made.T_us_ct_peak = T_us_ct_peak;
  RegistrationOptions options = quick_options("confidence: {evidence: patient}");
  options.search.rounds = rounds;
  options.confidence.gates.max_wrong_probability = limit;
  options.search.starts->count = kStarts;
  options.search.levels.resize(1);
  LevelOptions& level = options.search.levels.front();
  level.optimizer.method = OptimizerMethod::kBobyqa;
  level.screened = level.optimised = 4;
  options.refinement->optimizer.max_evaluations = refining;
  const PreparedCt ct(agar_case().ct);
  const registration::RegistrationInput input{agar_case().us, ct, made.T_us_ct_initial, options};
  const RegistrationHooks hooks;
  registration::Run run(hooks);
  const registration::ImagePyramid images = *registration::prepare(input, run);
  made.field = images.prepared.field;
  const PeaksSimilarity peak(made.field, {{made.T_us_ct_peak, 1.0, 20.0}});
  const Counting searched(peak);
  const Counting screening(peak);
  registration::Attempt attempt = registration::attempt_on(images, input, run);
  attempt.problem.similarities = {{&searched, &screening}};
  made.result = registration::judged_as_patient(attempt)->result;
  made.starts = screening.asked;
  made.own_evaluations = searched.asked + screening.asked;
  made.evaluations = run.evaluations();
  return made;
}

Isometry3d far_peak() { return beside_truth(agar_case(), {4, -3, 5}, {20, 5, -6}); }
/// The mirror images do not fit better than what is near it.
Isometry3d near_peak() { return beside_truth(agar_case(), {2, -2, 2}, {6, 2, -3}); }

const JudgedPeak& far_in_two_rounds() {
  static const JudgedPeak two = judged(2, far_peak());
  return two;
}
const JudgedPeak& near_in_two_rounds() {
  static const JudgedPeak two = judged(2, near_peak(), 0.3, 1);
  return two;
}

TEST(JudgedAsPatient, AnotherRoundFollowsAPoseThatMayBeMissed) {
  EXPECT_EQ(near_in_two_rounds().starts, 2 * kStarts) << near_in_two_rounds().result.message;
}

/// More starts would find the same.
TEST(JudgedAsPatient, NoRoundFollowsAPoseThatFitsMirrored) {
  EXPECT_EQ(far_in_two_rounds().starts, kStarts);
}

TEST(JudgedAsPatient, APoseThatPassesEndsTheSearch) {
  const JudgedPeak passed = judged(2, near_peak(), 1.0);
  EXPECT_EQ(passed.result.status, RegistrationStatus::kRegistered);
  EXPECT_EQ(passed.starts, kStarts);
}

/// What has had more starts must be better than mirror images that have had as many.
TEST(JudgedAsPatient, MirrorImagesAreSearchedForInAsManyRounds) {
  const auto of_patient = [](const JudgedPeak& of) { return of.evaluations - of.own_evaluations; };
  const int first_round = of_patient(judged(1, near_peak(), 0.3, 1));
  EXPECT_GT(of_patient(near_in_two_rounds()) - first_round, 1.3 * first_round);
}

TEST(JudgedAsPatient, ThePoseIsThatOfTheOwnSearchAfterItsRefinement) {
  const JudgedPeak& made = far_in_two_rounds();
  const Isometry3d T_pose = made.result.candidates.at(0).T_us_ct;
  const Measures& measures = made.result.measures;
  const auto from_mm = [&](const Isometry3d& T) { return made.field.distance_mm(T_pose, T); };
  EXPECT_LT(from_mm(made.T_us_ct_peak), 10.0);
  EXPECT_NEAR(measures.displacement_mm.value(), from_mm(made.T_us_ct_initial), 1e-9);
  EXPECT_GT(measures.disagreement_mm.value(), 0.5);
  EXPECT_NEAR(measures.disagreement_mm.value(), from_mm(made.T_us_ct_peak), 0.2);
  EXPECT_EQ(measures.overlap, made.result.overlap);
}

TEST(JudgedAsPatient, TheEvidenceCountsWithTheMeasuresOfThePose) {
  const Measures& measures = far_in_two_rounds().result.measures;
  ASSERT_TRUE(measures.wrong_probability);
  EXPECT_EQ(measures.wrong_probability, wrong_probability(measures));
}

/// The search of `patient` finds the truth, where the similarity is higher.
TEST(JudgedAsPatient, APoseIsComparedWithABetterOptimumElsewhere) {
  const RegistrationResult& result = far_in_two_rounds().result;
  EXPECT_LT(result.measures.rival_ratio.value(), 0.9);
  EXPECT_LT(result.measures.rival_ratio, result.measures.chance_ratio);
  EXPECT_LT(result.measures.rival_advantage.value(), 0.0);
  EXPECT_EQ(result.status, RegistrationStatus::kLowConfidence);
}

}  // namespace
}  // namespace usct::test
