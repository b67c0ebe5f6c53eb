#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "core/evaluation/small_study.h"
#include "core/io/expect_input_error.h"
#include "core/io/file_text.h"
#include "core/io/temporary_folder.h"
#include "us_ct_registration/evaluation/negative_cases.h"
#include "us_ct_registration/evaluation/study_report.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/ultrasound/scan_conversion.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

Vector3d centroid(const std::vector<Vector3d>& points) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& p : points) sum += p;
  return sum / static_cast<double>(points.size());
}

/// Returns the start as the result; refuses if it rotates the CT by 2 rad or more.
RegistrationResult register_nothing(const PreScanVolume& ultrasound, const CtVolume& ct,
                                    const Isometry3d& T_us_ct_initial) {
  RegistrationResult result;
  result.similarity = ultrasound.voxels[5] + ct.voxels[0];
  result.candidates = {{T_us_ct_initial, 0.5, 1.0}};
  if (Eigen::AngleAxisd(T_us_ct_initial.linear()).angle() < 2.0) {
    result.status = RegistrationStatus::kRegistered;
    result.T_us_ct = T_us_ct_initial;
    result.covariance = Eigen::Matrix<double, 6, 6>::Identity() * 1e-4;
  } else {
    result.status = RegistrationStatus::kLowConfidence;
  }
  result.message = status_name(result.status);
  return result;
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
  options.seed = 2;
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

TEST(PlanTrials, NegativesAreWhatTheySay) {
  const std::vector<StudyCase> cases = small_cases();
  StudyOptions options;
  options.starts = 3;
  options.negatives = true;
  options.max_displacement_mm = 12.0;
  const std::vector<Trial> trials = plan_trials(cases, options);
  ASSERT_EQ(trials.size(), 5U * 5U * 3U);
  std::set<std::size_t> partners_of_first;
  for (const Trial& trial : trials) {
    const StudyCase& own = cases[trial.us_case];
    const StudyCase& other = cases[trial.ct_case];
    EXPECT_EQ(trial.us_case != trial.ct_case, trial.kind == TrialKind::kMismatched);
    const PreScanVolume us = trial_ultrasound(cases, trial);
    EXPECT_EQ(us.voxels == own.ultrasound.voxels,
              trial.kind != TrialKind::kMirrored && trial.kind != TrialKind::kNoise);
    if (trial.kind == TrialKind::kMirrored) {
      EXPECT_EQ(us.voxels, mirrored(own.ultrasound).voxels);
    }
    if (trial.kind == TrialKind::kMismatched) {
      EXPECT_EQ(other.group(), own.group());
      if (trial.us_case == 0) partners_of_first.insert(trial.ct_case);
      // The start puts the other kidney at the place of this one, up to their different shapes.
      const Vector3d centre = centroid(own.targets_us_mm);
      const Vector3d other_centre = other.T_us_ct_true.inverse() * centroid(other.targets_us_mm);
      EXPECT_LT((trial.T_us_ct_initial * other_centre - centre).norm(), 12.0);
    }
    if (trial.kind == TrialKind::kFarStart) {
      EXPECT_GE(trial.displacement_mm, 60.0);
      EXPECT_LE(trial.displacement_mm, 100.0);
    }
    if (trial.kind == TrialKind::kNoOverlap) {
      EXPECT_EQ(
          trial.T_us_ct_initial.matrix(),
          moved_apart(own.T_us_ct_true, own.ct.grid, own.ultrasound.geometry, 150.0, trial.seed)
              .matrix());
    }
    if (trial.kind == TrialKind::kNoise) {
      EXPECT_LE(trial.displacement_mm, 12.0);
    }
  }
  EXPECT_EQ(partners_of_first, (std::set<std::size_t>{1, 3}));
}

TEST(PlanTrials, RefusesWhatCannotBeStudied) {
  const std::vector<StudyCase> cases = small_cases();
  StudyOptions negatives;
  negatives.negatives = true;
  expect_input_error([] { plan_trials({}, {}); }, {"cases", "at least 1"});
  expect_input_error([&] { plan_trials({cases[0], cases[0]}, {}); }, {"two are named 'a_1'"});
  expect_input_error(
      [&] {
        plan_trials({cases[0], cases[2]}, negatives);
      },
      {"'a_1' is the only one of its group"});
  StudyOptions options;
  options.starts = 0;
  expect_input_error([&] { plan_trials(cases, options); }, {"'starts' is 0", ">= 1"});
  options = {};
  options.max_displacement_mm = -1.0;
  expect_input_error([&] { plan_trials(cases, options); }, {"'max_displacement_mm' is -1"});
}

TEST(RunTrials, TellTheErrorsOfWhatWasFound) {
  const std::vector<StudyCase> cases = small_cases();
  const std::vector<Trial> trials = plan_trials(cases, {});
  const std::vector<StudyRun> runs =
      run_trials(cases, trials, register_nothing, StudyThreads::kOverTrials, 2);
  ASSERT_EQ(runs.size(), trials.size());
  std::size_t accepted = 0;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    EXPECT_EQ(runs[i].case_name, cases[trials[i].us_case].name);
    EXPECT_NEAR(runs[i].before->rigid.mean_mm, trials[i].displacement_mm, 1e-9);
    EXPECT_NEAR(runs[i].candidates.at(0).rigid.mean_mm, trials[i].displacement_mm, 1e-9);
    EXPECT_EQ(runs[i].candidates.at(0).physical.per_target_mm,
              runs[i].candidates.at(0).rigid.per_target_mm);
    EXPECT_EQ(runs[i].after.has_value(), runs[i].accepted());
    EXPECT_EQ(runs[i].expected.has_value(), runs[i].accepted());
    if (!runs[i].accepted()) continue;
    ++accepted;
    EXPECT_NEAR(runs[i].after->rigid.mean_mm, trials[i].displacement_mm, 1e-9);
  }
  EXPECT_GT(accepted, 0U);
  EXPECT_LT(accepted, runs.size());
}

TEST(RunTrials, DoNotDependOnThreads) {
  const std::vector<StudyCase> cases = small_cases();
  StudyOptions options;
  options.negatives = true;
  const std::vector<Trial> trials = plan_trials(cases, options);
  const TemporaryFolder folder;
  const auto json = [&](StudyThreads how, int threads) {
    write_study_json(run_trials(cases, trials, register_nothing, how, threads), {},
                     folder.path() / "study.json");
    return read_text(folder.path() / "study.json");
  };
  const std::string one = json(StudyThreads::kOverTrials, 1);
  EXPECT_EQ(json(StudyThreads::kOverTrials, 3), one);
  EXPECT_EQ(json(StudyThreads::kWithinTrial, 2), one);
}

TEST(RunTrials, WithoutTruthThereAreNoErrors) {
  const std::vector<StudyCase> cases = small_cases();
  StudyOptions options;
  options.negatives = true;
  options.starts = 1;
  for (const StudyRun& run : run_trials(cases, plan_trials(cases, options), register_nothing,
                                        StudyThreads::kOverTrials, 1)) {
    EXPECT_EQ(run.before.has_value(), run.trial.kind == TrialKind::kFarStart);
    EXPECT_EQ(run.candidates.empty(), run.trial.kind != TrialKind::kFarStart);
  }
}

// The first target was 3 mm deeper during the ultrasound than the rigid truth says, the others are
// where it says. From the truth itself, the error is that of this target alone.
TEST(RunTrials, ThePhysicalErrorIncludesTheDeformation) {
  StudyCase deformed = small_case("a_1", 1);
  deformed.targets_us_mm[0].y() += 3.0;
  StudyOptions options;
  options.starts = 1;
  options.max_displacement_mm = 0.0;
  const std::vector<StudyRun> runs = run_trials({deformed}, plan_trials({deformed}, options),
                                                register_nothing, StudyThreads::kOverTrials, 1);
  for (const PoseErrors& errors : {*runs[0].before, *runs[0].after, runs[0].candidates.at(0)}) {
    EXPECT_NEAR(errors.rigid.max_mm, 0.0, 1e-9);
    EXPECT_NEAR(errors.physical.per_target_mm[0], 3.0, 1e-9);
    EXPECT_NEAR(errors.physical.mean_mm, 0.75, 1e-9);
    EXPECT_NEAR(errors.physical.rms_mm, 1.5, 1e-9);
    EXPECT_NEAR(errors.physical.median_mm, 0.0, 1e-9);
    EXPECT_NEAR(errors.physical.max_mm, 3.0, 1e-9);
  }
}

TEST(RunTrials, AFailureEndsTheStudy) {
  const std::vector<StudyCase> cases = small_cases();
  std::atomic<int> calls{0};
  const Register fails = [&](const PreScanVolume&, const CtVolume&, const Isometry3d&) {
    if (++calls == 3) throw InputError("registration", "refuses its options");
    return RegistrationResult{};
  };
  expect_input_error(
      [&] { run_trials(cases, plan_trials(cases, {}), fails, StudyThreads::kOverTrials, 2); },
      {"refuses its options"});
  expect_input_error(
      [&] { run_trials(cases, plan_trials(cases, {}), fails, StudyThreads::kOverTrials, 0); },
      {"threads"});
}

TEST(StudyRun, SecondsAreTheTotalOrTheSumOfStages) {
  StudyRun run;
  run.result.seconds = {{"coarse", 1.5}, {"fine", 2.0}};
  EXPECT_DOUBLE_EQ(run.seconds(), 3.5);
  run.result.seconds["total"] = 4.0;
  EXPECT_DOUBLE_EQ(run.seconds(), 4.0);
}

TEST(StudyCase, IsReadAsPhantomsAreWritten) {
  const StudyCase written = small_case("patient_7", 3);
  const TemporaryFolder parent;
  const std::filesystem::path folder = parent.path() / "patient_7";
  std::filesystem::create_directory(folder);
  expect_input_error([&] { read_study_case(folder); }, {"patient_7", "has 0 of ct.nrrd"});
  write_volume(written.ct, folder / "ct.nii.gz");
  write_prescan_nrrd(written.ultrasound, folder / "us.nrrd");
  write_T_us_ct(written.T_us_ct_true, folder / "truth.tfm");
  write_points_mm(written.targets_us_mm, folder / "targets.csv");
  const StudyCase read = read_study_case(folder / "");
  EXPECT_EQ(read.name, "patient_7");
  EXPECT_EQ(read.group(), "patient");
  EXPECT_EQ(read.ct.voxels, written.ct.voxels);
  EXPECT_EQ(read.ultrasound.voxels, written.ultrasound.voxels);
  EXPECT_TRUE(read.T_us_ct_true.isApprox(written.T_us_ct_true, 1e-12));
  EXPECT_EQ(read.targets_us_mm, written.targets_us_mm);
  EXPECT_EQ(read.targets_ct_mm, ct_points_mm(read.T_us_ct_true, read.targets_us_mm));
  write_points_mm({{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {10, 11, 12}}, folder / "targets_ct.csv");
  EXPECT_EQ(read_study_case(folder).targets_ct_mm[2], Vector3d(7, 8, 9));
  write_points_mm({{1, 2, 3}}, folder / "targets_ct.csv");
  expect_input_error([&] { read_study_case(folder); },
                     {"targets_ct.csv", "has 1 points", "as many as targets.csv, 4"});
  write_volume(written.ct, folder / "ct.mha");
  expect_input_error([&] { read_study_case(folder); }, {"has 2 of"});
}

TEST(StudyReport, TablesHoldTheStatistics) {
  const std::vector<StudyRun> runs{run_with_error("b", 1.0, 3.0, 2.0),
                                   run_with_error("b", 2.5, 12.0, 8.0),
                                   run_with_error("b", -1.0, 19.0, 3.0)};
  const std::string table = accuracy_markdown(runs, {0.0, 10.0, 20.0});
  EXPECT_NE(table.find("| b | 3 | 1 | 1.75 / 1.75 / 1.06 | 1.75 / 1.75 / 1.06 | "
                       "2.75 / 2.75 / 3.50 | 33.3 | 66.7 | 66.7 | 2.50 | 3.00 | 100.0 of 1 | "
                       "50.0 of 2 |"),
            std::string::npos)
      << table;
  EXPECT_EQ(calibration_markdown(runs), "No accepted run tells an expected error.\n");
  EXPECT_EQ(negatives_markdown(runs), "");
}

TEST(StudyReport, ThesisTableIsPerCase) {
  const std::vector<StudyRun> runs{run_with_error("b", 1.0, 3.0, 2.0),
                                   run_with_error("b", 2.0, 3.0, 4.0),
                                   run_with_error("b", 9.0, 3.0, 6.0)};
  const std::string table = thesis_markdown({small_case("b_1", 1)}, runs);
  EXPECT_NE(
      table.find("| b_1 | 3 | 66.7 | 1.50 | 0.71 | (24, 12, 6) | (4.00 mm, 2.86 deg, 5.73 deg) "
                 "| 4.00 |"),
      std::string::npos)
      << table;
}

TEST(StudyReport, ThesisTableTellsTheSizeOfWhatIsRegistered) {
  const StudyCase study_case = small_case("b_1", 1);
  BeamOptions parallel;
  parallel.parallel_beams_mm = 8.0;
  const Grid grid = fan_grid(study_case.ultrasound.geometry, 8.0);
  const std::string table =
      thesis_markdown({study_case}, {run_with_error("b", 1.0, 3.0, 2.0)}, parallel);
  EXPECT_NE(table.find("(" + std::to_string(grid.size.x()) + ", " + std::to_string(grid.size.y()) +
                       ", " + std::to_string(grid.size.z()) + ") | (8.00 mm, 8.00 mm, 8.00 mm)"),
            std::string::npos)
      << table;
}

TEST(StudyReport, NegativesAreCountedByStatus) {
  std::vector<StudyRun> runs{run_with_error("b", -1.0), run_with_error("b", 1.0)};
  for (StudyRun& run : runs) run.trial.kind = TrialKind::kMirrored;
  runs[1].after.reset();
  const std::string table = negatives_markdown(runs);
  EXPECT_NE(table.find("| mirrored | 2 | 1 (low_confidence 1) | - | 1 |"), std::string::npos)
      << table;
}

TEST(StudyReport, JsonTellsEveryRunAndNullForWhatIsUnknown) {
  const std::vector<StudyCase> cases = small_cases();
  const std::vector<Trial> trials = plan_trials(cases, {});
  std::vector<StudyRun> runs =
      run_trials({cases}, {trials[0], trials[9]}, register_nothing, StudyThreads::kOverTrials, 1);
  runs[0].result.overlap = std::nan("");
  runs[0].result.options = {{"depth_error", "0.01"}};
  const TemporaryFolder folder;
  write_study_json(runs, {{"seed", "1"}}, folder.path() / "study.json");
  const auto json = nlohmann::json::parse(read_text(folder.path() / "study.json"));
  EXPECT_EQ(json["study"]["seed"], "1");
  ASSERT_EQ(json["runs"].size(), 2U);
  const auto& first = json["runs"][0];
  EXPECT_EQ(first["case"], "a_1");
  EXPECT_EQ(first["kind"], "start");
  EXPECT_EQ(first["status"], status_name(runs[0].result.status));
  EXPECT_EQ(first["options"]["depth_error"], "0.01");
  EXPECT_TRUE(first["overlap"].is_null());
  EXPECT_EQ(first["before_tre_mm"]["mean"], runs[0].before->rigid.mean_mm);
  EXPECT_EQ(first["before_physical_mm"]["median"], runs[0].before->physical.median_mm);
  EXPECT_EQ(first["candidates"][0]["tre_mm"]["max"], runs[0].candidates[0].rigid.max_mm);
  EXPECT_EQ(first["candidates"][0]["physical_mm"]["rms"], runs[0].candidates[0].physical.rms_mm);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(json["runs"][i]["tre_mm"].is_null(), !runs[i].accepted());
    EXPECT_EQ(json["runs"][i]["physical_mm"].is_null(), !runs[i].accepted());
    EXPECT_EQ(json["runs"][i]["T_us_ct"].is_null(), !runs[i].accepted());
  }
}

}  // namespace
}  // namespace usct::test
