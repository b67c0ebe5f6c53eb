#include <gtest/gtest.h>

#include <map>
#include <set>

#include "core/evaluation/small_study.h"
#include "core/io/expect_input_error.h"
#include "evaluation/negative_cases.h"
#include "us_ct_registration/evaluation/trials.h"
#include "us_ct_registration/geometry/target_errors.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

Vector3d centroid(const std::vector<Vector3d>& points) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& p : points) sum += p;
  return sum / static_cast<double>(points.size());
}

TEST(TrialKind, IsReadFromItsNameWithDashesForBlanks) {
  for (const TrialKind kind : negative_kinds())
    EXPECT_EQ(parse_kind(kind_name(kind), "--kinds"), kind);
  EXPECT_EQ(parse_kind("half-turn", "--kinds"), TrialKind::kHalfTurn);
  EXPECT_EQ(parse_kind("start", "--kinds"), TrialKind::kStart);
  EXPECT_EQ(negative_kinds().size(), 10U);
  expect_input_error([] { parse_kind("upside-down", "--kinds"); },
                     {"--kinds", "'upside-down'",
                      "must be one of start, mismatched, mirrored, no-overlap, noise, far-start, "
                      "frames-reversed, half-turn, ct-mirrored, ct-axes-swapped, stranger"});
}

TEST(PlanTrials, StartsAreAsFarFromTheTruthAsAsked) {
  const std::vector<StudyCase> cases = small_cases();
  StudyOptions options;
  options.starts = 6;
  options.min_displacement_mm = 3.0;
  options.max_displacement_mm = 18.0;
  const std::vector<Trial> trials = plan_trials(cases, options);
  ASSERT_EQ(trials.size(), 30U);
  for (const Trial& trial : trials) {
    const StudyCase& own = cases[trial.us_case];
    EXPECT_EQ(trial.ct_case, trial.us_case);
    const double error =
        evaluate_targets(trial.T_us_ct_initial, own.T_us_ct_true, own.targets_us_mm).mean_mm;
    EXPECT_NEAR(error, trial.displacement_mm, 1e-9);
    const int bin = trial.index % 3;
    EXPECT_GE(error, 3.0 + 5.0 * bin);
    EXPECT_LE(error, 8.0 + 5.0 * bin);
  }
}

TEST(PlanTrials, OfACaseDependOnTheSeedButNotOnOtherCases) {
  const std::vector<StudyCase> cases = small_cases();
  StudyOptions options;
  const std::vector<Trial> all = plan_trials(cases, options);
  const std::vector<Trial> alone = plan_trials({cases[2]}, options);
  for (std::size_t i = 0; i < alone.size(); ++i)
    EXPECT_EQ(alone[i].T_us_ct_initial.matrix(), all[2 * 9 + i].T_us_ct_initial.matrix());
  options.seeds = {2};
  EXPECT_NE(plan_trials({cases[2]}, options)[0].T_us_ct_initial.matrix(),
            alone[0].T_us_ct_initial.matrix());
  EXPECT_NE(alone[0].seed, alone[1].seed);
}

TEST(PlanTrials, StartsFromABoxStayInIt) {
  const std::vector<StudyCase> cases = small_cases();
  StudyOptions options;
  options.box = MotionBox{0.1, 4.0};
  for (const Trial& trial : plan_trials(cases, options)) {
    const StudyCase& own = cases[trial.us_case];
    const Isometry3d motion = trial.T_us_ct_initial * own.T_us_ct_true.inverse();
    const Vector3d centre = centroid(own.targets_us_mm);
    EXPECT_LE((motion * centre - centre).cwiseAbs().maxCoeff(), 4.0 + 1e-9);
  }
}

TEST(PlanTrials, ACaseHasStartsOfEveryKind) {
  std::vector<StudyCase> cases = small_cases();
  cases.push_back(small_stranger("s_6", 6));
  StudyOptions options;
  options.starts = 3;
  options.kinds = negative_kinds();
  options.max_displacement_mm = 12.0;
  std::map<TrialKind, std::map<std::size_t, int>> starts;
  for (const Trial& trial : plan_trials(cases, options)) {
    ++starts[trial.kind][trial.us_case];
    if (trial.kind == TrialKind::kFarStart) {
      EXPECT_GE(trial.displacement_mm, 60.0);
      EXPECT_LE(trial.displacement_mm, 100.0);
    } else if (trial.kind != TrialKind::kNoOverlap) {
      EXPECT_LE(trial.displacement_mm, 12.0 + 1e-9);
    }
  }
  ASSERT_EQ(starts.size(), negative_kinds().size());
  for (const auto& [kind, of_cases] : starts)
    EXPECT_EQ(of_cases, (std::map<std::size_t, int>{{0, 3}, {1, 3}, {2, 3}, {3, 3}, {4, 3}}))
        << kind_name(kind);
}

/// The trials of one kind.
std::vector<Trial> trials_of(const std::vector<StudyCase>& cases, TrialKind kind, int starts = 3) {
  StudyOptions options;
  options.starts = starts;
  options.kinds = {kind};
  options.max_displacement_mm = 12.0;
  return plan_trials(cases, options);
}

TEST(PlanTrials, MismatchedCasesAreOfTheSameGroupWithTheirKidneyInPlace) {
  std::vector<StudyCase> cases = small_cases();
  std::set<std::size_t> partners_of_first;
  for (const Trial& trial : trials_of(cases, TrialKind::kMismatched)) {
    const StudyCase& own = cases[trial.us_case];
    const StudyCase& other = cases[trial.ct_case];
    EXPECT_NE(trial.us_case, trial.ct_case);
    EXPECT_EQ(other.group(), own.group());
    if (trial.us_case == 0) partners_of_first.insert(trial.ct_case);
    // The start puts the other kidney at the place of this one, up to their different shapes.
    const Vector3d other_centre = other.T_us_ct_true.inverse() * centroid(other.targets_us_mm);
    EXPECT_LT((trial.T_us_ct_initial * other_centre - centroid(own.targets_us_mm)).norm(), 12.0);
  }
  EXPECT_EQ(partners_of_first, (std::set<std::size_t>{1, 3}));
}

TEST(PlanTrials, StrangersComeInTurnWithTheirKidneyInPlace) {
  std::vector<StudyCase> cases = small_cases();
  for (const int number : {6, 7, 8})
    cases.push_back(small_stranger("s_" + std::to_string(number), number));
  std::map<std::size_t, std::vector<std::size_t>> strangers;
  for (const Trial& trial : trials_of(cases, TrialKind::kStranger, 4)) {
    strangers[trial.us_case].push_back(trial.ct_case);
    const Vector3d centre = centroid(cases[trial.ct_case].targets_ct_mm);
    EXPECT_LT(
        (trial.T_us_ct_initial * centre - centroid(cases[trial.us_case].targets_us_mm)).norm(),
        12.0);
  }
  ASSERT_EQ(strangers.size(), 5U);
  for (const auto& [own, others] : strangers) {
    EXPECT_EQ(std::set<std::size_t>(others.begin(), others.end()),
              (std::set<std::size_t>{5, 6, 7}));
    EXPECT_EQ(others[0], others[3]);
  }
}

/// Of the phantoms of one seed in two groups the kidney is the same one.
TEST(PlanTrials, NoCaseOfTheSameSubjectIsAWrongOne) {
  std::vector<StudyCase> cases{small_case("a_1", 1), small_stranger("s_1", 6),
                               small_stranger("s_2", 7)};
  for (const Trial& trial : trials_of(cases, TrialKind::kStranger)) EXPECT_EQ(trial.ct_case, 2U);
  cases.pop_back();
  expect_input_error([&] { trials_of(cases, TrialKind::kStranger); },
                     {"strangers", "all are of the subject '1' as 'a_1'"});
}

TEST(PlanTrials, ImagesOfNegativesAreWhatTheySay) {
  const std::vector<StudyCase> cases = small_cases();
  const auto us_of = [&](TrialKind kind) {
    return trial_ultrasound(cases[0], trials_of(cases, kind)[0]).voxels;
  };
  const PreScanVolume& us = cases[0].ultrasound;
  EXPECT_EQ(us_of(TrialKind::kMirrored), lines_reversed(us).voxels);
  EXPECT_EQ(us_of(TrialKind::kFramesReversed), frames_reversed(us).voxels);
  EXPECT_EQ(us_of(TrialKind::kHalfTurn), lines_reversed(frames_reversed(us)).voxels);
  EXPECT_NE(us_of(TrialKind::kNoise), us.voxels);
  for (const TrialKind kind : {TrialKind::kMismatched, TrialKind::kCtMirrored,
                               TrialKind::kCtAxesSwapped, TrialKind::kFarStart})
    EXPECT_EQ(us_of(kind), us.voxels) << kind_name(kind);

  const Vector3d centre = centroid(cases[0].targets_ct_mm);
  for (const TrialKind kind : negative_kinds()) {
    if (kind == TrialKind::kStranger) continue;
    const Trial trial = trials_of(cases, kind)[0];
    const std::optional<CtVolume> ct = altered_ct(cases[trial.ct_case], trial);
    EXPECT_EQ(ct.has_value(), kind == TrialKind::kCtMirrored || kind == TrialKind::kCtAxesSwapped);
    if (kind == TrialKind::kCtMirrored) {
      EXPECT_TRUE(same_grid(ct->grid, mirrored_ct(cases[0].ct, centre).grid));
    }
    if (kind == TrialKind::kCtAxesSwapped) {
      EXPECT_TRUE(same_grid(ct->grid, axes_swapped_ct(cases[0].ct, centre).grid));
    }
    if (kind == TrialKind::kNoOverlap) {
      EXPECT_EQ(trial.T_us_ct_initial.matrix(),
                moved_apart(cases[0].T_us_ct_true, cases[0].ct.grid, us.geometry, 150.0, trial.seed)
                    .matrix());
    }
  }
}

TEST(PlanTrials, RefusesWhatCannotBeStudied) {
  const std::vector<StudyCase> cases = small_cases();
  StudyOptions mismatched;
  mismatched.kinds = {TrialKind::kMismatched};
  expect_input_error([] { plan_trials({}, {}); }, {"cases", "at least 1"});
  expect_input_error([&] { plan_trials({cases[0], cases[0]}, {}); }, {"two are named 'a_1'"});
  expect_input_error(
      [&] {
        plan_trials({cases[0], cases[2]}, mismatched);
      },
      {"'a_1' is the only one of its group"});
  const StudyCase stranger = small_stranger("s_1", 6);
  expect_input_error([&] { plan_trials({stranger}, {}); }, {"cases", "at least 1"});
  expect_input_error(
      [&] {
        plan_trials({cases[0], stranger}, {});
      },
      {"strangers", "'stranger' is not among the kinds"});
  StudyOptions options;
  options.kinds = {TrialKind::kStranger};
  expect_input_error([&] { plan_trials(cases, options); }, {"strangers", "there are 0"});
  options.kinds = {TrialKind::kNoise, TrialKind::kMirrored, TrialKind::kNoise};
  expect_input_error([&] { plan_trials(cases, options); }, {"'kinds' has 'noise' twice"});
  options.kinds = {};
  expect_input_error([&] { plan_trials(cases, options); }, {"'kinds' is empty"});
  options = {};
  options.starts = 0;
  expect_input_error([&] { plan_trials(cases, options); }, {"'starts' is 0", ">= 1"});
  options = {};
  options.max_displacement_mm = -1.0;
  expect_input_error([&] { plan_trials(cases, options); }, {"'max_displacement_mm' is -1"});
}

}  // namespace
}  // namespace usct::test
