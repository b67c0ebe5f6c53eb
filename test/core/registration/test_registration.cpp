#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <map>
#include <random>

#include "core/registration/registration_cases.h"
#include "us_ct_registration/threads.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using phantom::SceneKind;
using phantom::SweepKind;

/// Samples are 2 mm apart, lines and frames more; an error of about a third of that is good.
constexpr double kGoodMm = 1.0;

/// Registers from both sides of the truth, in as many rounds as it takes.
void expect_recovered(const RegistrationCase& images) {
  RegistrationOptions options = quick_options();
  options.search.rounds = 3;
  for (const double sign : {1.0, -1.0}) {
    const Isometry3d initial = nearby(images, sign);
    ASSERT_GT(images.error_mm(initial), 8.0);
    const RegistrationResult result = registered(images, initial, options);
    ASSERT_EQ(result.status, RegistrationStatus::kRegistered) << sign << ": " << result.message;
    ASSERT_TRUE(result.T_us_ct);
    EXPECT_LT(images.error_mm(*result.T_us_ct), kGoodMm) << sign;
    EXPECT_EQ(result.T_us_ct->matrix(), result.candidates.front().T_us_ct.matrix());
    EXPECT_EQ(result.similarity, result.candidates.front().similarity);
    EXPECT_GT(result.overlap, 0.5);
    EXPECT_LE(result.overlap, 1.0);
    EXPECT_GT(result.evaluations, 100);
  }
}

const Isometry3d kUsMotion = rigid({0.4, -1.1, 0.7}, {120, -340, 55});
const Isometry3d kCtMotion = rigid({-0.9, 0.3, 1.4}, {-210, 80, 600});

TEST(Registration, RecoversMotorisedAgar) { expect_recovered(agar_case()); }

TEST(Registration, RecoversTrackedPatient) { expect_recovered(patient_case()); }

TEST(Registration, PresetsAcceptWhatTheyFind) {
  for (const RegistrationCase* images : {&agar_case(), &patient_case()})
    for (const char* name : {"patient", "phantom", "fast"}) {
      const RegistrationResult result = registered(*images, nearby(*images), preset(name));
      ASSERT_EQ(result.status, RegistrationStatus::kRegistered) << name << ": " << result.message;
      EXPECT_LT(images->error_mm(*result.T_us_ct), 2.0 * kGoodMm) << name;
    }
}

TEST(Registration, RecoversCartesianVolume) {
  const UsVolume volume = in_space(agar_phantom().ultrasound, 1.5, {}).volume;
  expect_recovered(case_of(agar_phantom(), volume));
}

TEST(Registration, RecoversParallelBeamsOfSweep) {
  BeamOptions how;
  how.parallel_beams_mm = 1.5;
  expect_recovered(case_of(agar_phantom(), agar_phantom().ultrasound, how));
}

/// The probe of this scene presses: the wall moves, the kidney hardly does.
TEST(Registration, FollowsTheKidneyAndNotThePressedWall) {
  phantom::PhantomOptions options;  // full size: coarse images hardly show the wall
  options.scene = SceneKind::kPatient;
  options.seed = 105;
  options.ct.size = {220, 180, 90};
  options.sweep.frames = 41;
  const RegistrationCase images = make_case(options);
  const auto too_deep_mm = [&](const std::string& changes) {
    const RegistrationResult result =
        registered(images, images.T_us_ct_true, quick_options(changes));
    const Isometry3d error = result.candidates.at(0).T_us_ct * images.T_us_ct_true.inverse();
    double sum = 0.0;
    for (const Vector3d& target : images.targets_us_mm) sum += (error * target - target).y();
    return sum / static_cast<double>(images.targets_us_mm.size());
  };
  const double with_wall_mm = too_deep_mm("refinement: {similarity: {pressed_mm: 0}}\n");
  const double without_mm = too_deep_mm("");
  EXPECT_GT(with_wall_mm, 0.4);
  EXPECT_LT(std::abs(without_mm), 0.6 * with_wall_mm);
}

TEST(Registration, RecoversInAnyFrames) {
  expect_recovered(moved(patient_case(), kUsMotion, kCtMotion));
}

TEST(Registration, FrameOfCtDoesNotMatter) {
  const RegistrationCase other = moved(patient_case(), Isometry3d::Identity(), kCtMotion);
  const RegistrationResult a = registered(patient_case(), nearby(patient_case()));
  const RegistrationResult b = registered(other, nearby(other));
  ASSERT_TRUE(a.T_us_ct && b.T_us_ct);
  EXPECT_LT(patient_case().error_mm(*b.T_us_ct * kCtMotion), kGoodMm);
  EXPECT_LT(
      evaluate_targets(*b.T_us_ct * kCtMotion, *a.T_us_ct, patient_case().targets_us_mm).max_mm,
      0.1);
  EXPECT_NEAR(b.similarity, a.similarity, 1e-3 * a.similarity);
}

/// The optimizers' steps turn with the frame of the ultrasound, so the results differ within the
/// optimizers' tolerances.
TEST(Registration, FrameOfUltrasoundDoesNotMatter) {
  const RegistrationCase other = moved(patient_case(), kUsMotion, Isometry3d::Identity());
  const RegistrationResult a = registered(patient_case(), nearby(patient_case()));
  const RegistrationResult b = registered(other, kUsMotion * nearby(patient_case()));
  ASSERT_TRUE(a.T_us_ct && b.T_us_ct);
  EXPECT_LT(
      evaluate_targets(kUsMotion.inverse() * *b.T_us_ct, *a.T_us_ct, patient_case().targets_us_mm)
          .max_mm,
      0.5);
}

void expect_same_bits(const RegistrationResult& a, const RegistrationResult& b) {
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.message, b.message);
  ASSERT_EQ(a.T_us_ct.has_value(), b.T_us_ct.has_value());
  if (a.T_us_ct) {
    EXPECT_EQ(a.T_us_ct->matrix(), b.T_us_ct->matrix());
  }
  EXPECT_EQ(a.similarity, b.similarity);
  EXPECT_EQ(a.overlap, b.overlap);
  EXPECT_EQ(a.evaluations, b.evaluations);
  EXPECT_EQ(by_name(a.measures), by_name(b.measures));
  EXPECT_EQ(a.covariance, b.covariance);
  ASSERT_EQ(a.candidates.size(), b.candidates.size());
  for (std::size_t i = 0; i < a.candidates.size(); ++i) {
    EXPECT_EQ(a.candidates[i].T_us_ct.matrix(), b.candidates[i].T_us_ct.matrix());
    EXPECT_EQ(a.candidates[i].similarity, b.candidates[i].similarity);
  }
}

RegistrationOptions with_method(OptimizerMethod method) {
  RegistrationOptions options = quick_options();
  options.search.levels.front().optimised = 2;
  for (LevelOptions& level : options.search.levels) level.optimizer.method = method;
  options.refinement->optimizer.method = method;
  return options;
}

TEST(Registration, SameBitsWithAnyNumberOfThreads) {
  for (const OptimizerMethod method : {OptimizerMethod::kBobyqa, OptimizerMethod::kCmaEs}) {
    const RegistrationOptions options = with_method(method);
    const Isometry3d initial = nearby(agar_case());
    const RegistrationResult first = registered(agar_case(), initial, options);
    ASSERT_TRUE(first.T_us_ct) << first.message;
    for (const int count : {1, 2, 3}) {
      SCOPED_TRACE(std::string(method_name(method)) + " with " + std::to_string(count));
      const ThreadCount threads(count);
      expect_same_bits(registered(agar_case(), initial, options), first);
    }
  }
}

// The search stops where it starts, and the refinement goes on to the truth.
TEST(Registration, EvidenceIsThatOfThePoseToWhichTheRefinementLeads) {
  RegistrationOptions options = quick_options();
  options.search.starts.reset();
  for (LevelOptions& level : options.search.levels) level.optimizer.max_evaluations = 1;
  const Isometry3d initial = beside_truth(agar_case(), {0, 0, 0}, {4, 2, 3});
  const RegistrationResult result = registered(agar_case(), initial, options);
  ASSERT_TRUE(result.T_us_ct) << result.message;
  EXPECT_LT(agar_case().error_mm(*result.T_us_ct), kGoodMm);
  EXPECT_LT(*result.measures.disagreement_mm, options.search.distinct_mm);
  EXPECT_NEAR(*result.measures.displacement_mm, Eigen::Vector3d(4, 2, 3).norm(), kGoodMm);
}

// Neither search nor refinement moves the pose: blocks of the field alone see where they would
// rather lie.
TEST(Registration, ARefusedPoseGoesOnToWhereItsBlocksWouldRatherLie) {
  RegistrationOptions options = quick_options("refinement: none\nconfidence: {evidence: own}");
  options.search.starts.reset();
  for (LevelOptions& level : options.search.levels) level.optimizer.max_evaluations = 1;
  const Isometry3d initial = beside_truth(agar_case(), {3, -2, 2}, {4, 2, 3});
  const RegistrationResult result = registered(agar_case(), initial, options);
  ASSERT_GT(agar_case().error_mm(initial), 5.0);
  EXPECT_LT(agar_case().error_mm(result.candidates.at(0).T_us_ct), 2.0 * kGoodMm) << result.message;
}

TEST(Registration, SeedMattersToCmaEsOnly) {
  for (const OptimizerMethod method : {OptimizerMethod::kBobyqa, OptimizerMethod::kCmaEs}) {
    RegistrationOptions options = with_method(method);
    const Isometry3d initial = nearby(agar_case());
    const RegistrationResult a = registered(agar_case(), initial, options);
    options.seed = 77;
    const RegistrationResult b = registered(agar_case(), initial, options);
    ASSERT_TRUE(a.T_us_ct && b.T_us_ct);
    EXPECT_EQ(a.T_us_ct->matrix() == b.T_us_ct->matrix(), method == OptimizerMethod::kBobyqa);
    EXPECT_LT(agar_case().error_mm(*b.T_us_ct), kGoodMm);
  }
}

/// `max_wrong_probability` decides whether the options' own evidence leaves doubt.
void expect_rising_progress(double max_wrong_probability) {
  const ThreadCount threads(3);
  std::vector<double> reported;
  std::atomic<int> inside{0};
  RegistrationHooks hooks;
  hooks.progress = [&](double fraction) {
    EXPECT_EQ(++inside, 1);
    reported.push_back(fraction);
    --inside;
  };
  RegistrationOptions options = quick_options();
  options.search.rounds = 2;
  options.confidence.gates.max_wrong_probability = max_wrong_probability;
  ASSERT_TRUE(registered(agar_case(), nearby(agar_case()), options, hooks).T_us_ct);
  ASSERT_GE(reported.size(), 4U);
  EXPECT_EQ(reported.front(), 0.0);
  EXPECT_EQ(reported.back(), 1.0);
  for (std::size_t i = 1; i < reported.size(); ++i) EXPECT_GT(reported[i], reported[i - 1]);
}

TEST(Registration, ProgressRisesFromZeroToOne) { expect_rising_progress(1.0); }

TEST(Registration, ProgressRisesWhereThePresetPatientGoesOn) { expect_rising_progress(0.1); }

/// Whoever is told that a registration has ended gets its result.
TEST(Registration, CannotBeCancelledOnceItHasEnded) {
  bool has_ended = false;
  RegistrationHooks hooks;
  hooks.progress = [&](double fraction) { has_ended = fraction == 1.0; };
  hooks.cancelled = [&] { return has_ended; };
  const RegistrationResult result =
      registered(agar_case(), nearby(agar_case()), quick_options(), hooks);
  EXPECT_TRUE(has_ended);
  EXPECT_EQ(result.status, RegistrationStatus::kRegistered);
}

TEST(Registration, AsksForCancellationFromOneThreadAtATime) {
  const ThreadCount threads(3);
  std::atomic<int> inside{0};
  int asked = 0;
  RegistrationHooks hooks;
  hooks.cancelled = [&] {
    EXPECT_EQ(++inside, 1);
    ++asked;
    --inside;
    return false;
  };
  const RegistrationResult result =
      registered(agar_case(), nearby(agar_case()), quick_options(), hooks);
  expect_same_bits(result, registered(agar_case(), nearby(agar_case())));
  EXPECT_GT(asked, result.evaluations / 4);
}

TEST(Registration, CancelsAtOnce) {
  constexpr int kThreads = 3;
  const ThreadCount threads(kThreads);
  for (const int allowed : {0, 1, 5, 40, 300}) {
    int asked = 0;
    RegistrationHooks hooks;
    hooks.cancelled = [&] { return asked++ >= allowed; };
    const RegistrationResult result =
        registered(agar_case(), nearby(agar_case()), quick_options(), hooks);
    EXPECT_EQ(result.status, RegistrationStatus::kCancelled);
    EXPECT_FALSE(result.message.empty());
    EXPECT_FALSE(result.T_us_ct);
    // Each thread may be at one evaluation, and asks once more at most.
    EXPECT_LE(asked, allowed + kThreads);
  }
}

TEST(Registration, WhatHooksThrowReachesTheCaller) {
  RegistrationHooks hooks;
  int asked = 0;
  hooks.cancelled = [&]() -> bool {
    if (++asked > 50) throw std::runtime_error("from the hook");
    return false;
  };
  EXPECT_THROW(registered(agar_case(), nearby(agar_case()), quick_options(), hooks),
               std::runtime_error);
}

RegistrationResult by_thesis_b(const RegistrationCase& images, double sign) {
  const RegistrationOptions options = parse_registration_options(
      "preset: thesis_b\nsearch: {levels: {0: {optimizer: {max_evaluations: 60}}}}\n", "test");
  const RegistrationResult result = registered(images, nearby(images, sign), options);
  EXPECT_GE(result.evaluations, 60);
  EXPECT_FALSE(result.candidates.empty()) << result.message;
  return result;
}

/// The thesis' similarity has no parts, so the evidence is gathered as for the preset `patient`.
TEST(Registration, ThesisVariantBRunsAndIsJudgedLikeEveryPreset) {
  const RegistrationResult result = by_thesis_b(patient_case(), 1.0);
  EXPECT_TRUE(result.candidates.at(0).T_us_ct.matrix().allFinite());
  // So few evaluations do not find the pose.
  EXPECT_GT(patient_case().error_mm(result.candidates.at(0).T_us_ct), 5.0);
  EXPECT_EQ(result.status, RegistrationStatus::kLowConfidence) << result.message;
  EXPECT_TRUE(result.measures.wrong_probability);
  EXPECT_TRUE(result.covariance);
}

/// A right pose of `quick_options`, which is beyond doubt below a tenth of the limit.
RegistrationResult judged_by(EvidenceSource source, double limit,
                             RegistrationOptions options = quick_options()) {
  options.confidence.evidence = source;
  options.confidence.gates.max_wrong_probability = limit;
  return registered(agar_case(), nearby(agar_case()), options);
}

TEST(Registration, APoseThatItsOwnEvidenceLeavesInDoubtIsLeftToThePresetPatient) {
  constexpr double kLowLimit = 0.1;
  const RegistrationResult own = judged_by(EvidenceSource::kOwn, kLowLimit);
  EXPECT_GT(own.measures.wrong_probability.value(), 0.1 * kLowLimit);
  RegistrationOptions patient;
  patient.search.rounds = quick_options().search.rounds;
  const RegistrationResult by_patient = judged_by(EvidenceSource::kOwn, kLowLimit, patient);
  EXPECT_NE(by_patient.measures.mirror_ratio, own.measures.mirror_ratio);
  RegistrationResult in_doubt = judged_by(EvidenceSource::kOwnFirst, kLowLimit);
  EXPECT_GT(in_doubt.evaluations, by_patient.evaluations);
  in_doubt.evaluations = by_patient.evaluations;
  expect_same_bits(in_doubt, by_patient);
}

TEST(Registration, APoseThatItsOwnEvidenceLeavesBeyondDoubtIsTheResult) {
  expect_same_bits(judged_by(EvidenceSource::kOwnFirst, 1.0), judged_by(EvidenceSource::kOwn, 1.0));
}

/// The images of `patient` judge the pose, but the expected error is the one that was asked for.
TEST(Registration, OptionsOfTheEvidenceHoldWhereThePoseIsJudgedAsPatientJudgesIt) {
  for (const EvidenceSource source : {EvidenceSource::kOwnFirst, EvidenceSource::kPatient}) {
    RegistrationOptions options = quick_options();
    options.confidence.evidence = source;
    options.confidence.gates.max_wrong_probability = 0.1;
    options.confidence.error.bound_factor = 3.0;
    const Measures measures = registered(agar_case(), nearby(agar_case()), options).measures;
    EXPECT_NEAR(measures.error_bound_mm.value(), 3.0 * measures.expected_error_mm.value(), 1e-12);
  }
}

RegistrationResult in_rounds(int most, const RegistrationCase& images) {
  RegistrationOptions options = quick_options();
  options.search.rounds = most;
  options.confidence.evidence = EvidenceSource::kOwn;
  return registered(images, nearby(images), options);
}

TEST(Registration, ARightPosePaysForNoSecondRound) {
  expect_same_bits(in_rounds(3, patient_case()), in_rounds(1, patient_case()));
}

TEST(Registration, TheSearchGoesOnWhereNothingIsBetterThanChance) {
  RegistrationCase noise = patient_case();
  std::mt19937 random(1);
  for (float& value : noise.us.brightness) value = static_cast<float>(random() % 256);
  EXPECT_GT(in_rounds(2, noise).evaluations, 1.1 * in_rounds(1, noise).evaluations);
}

}  // namespace
}  // namespace usct::test
