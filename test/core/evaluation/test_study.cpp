#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/evaluation/small_study.h"
#include "core/io/expect_input_error.h"
#include "core/io/file_text.h"
#include "core/io/temporary_folder.h"
#include "us_ct_registration/evaluation/study_report.h"
#include "us_ct_registration/evaluation/study_statistics.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/ultrasound/scan_conversion.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

TEST(RunTrials, TellTheErrorsOfWhatWasFound) {
  const std::vector<StudyCase> cases = small_cases();
  const std::vector<Trial> trials = plan_trials(cases, {});
  const std::vector<StudyRun> runs = runs_of(cases, trials, register_nothing);
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
  options.kinds = {TrialKind::kStart, TrialKind::kHalfTurn, TrialKind::kCtMirrored};
  const std::vector<Trial> trials = plan_trials(cases, options);
  const TemporaryFolder folder;
  const auto json = [&](StudyThreads how, int threads) {
    std::vector<StudyRun> runs = runs_of(cases, trials, register_nothing, how, threads);
    for (StudyRun& run : runs) run.peak_memory_mib.reset();
    write_study_json({}, runs, {}, folder.path() / "study.json");
    return read_text(folder.path() / "study.json");
  };
  const std::string one = json(StudyThreads::kOverTrials, 1);
  EXPECT_EQ(json(StudyThreads::kOverTrials, 3), one);
  EXPECT_EQ(json(StudyThreads::kWithinTrial, 2), one);
}

TEST(RunTrials, WithoutTruthThereAreNoErrors) {
  const std::vector<StudyCase> cases = small_cases();
  StudyOptions options;
  options.kinds = {TrialKind::kMirrored, TrialKind::kCtMirrored, TrialKind::kFarStart,
                   TrialKind::kHalfTurn};
  options.starts = 1;
  for (const StudyRun& run : runs_of(cases, plan_trials(cases, options), register_nothing)) {
    EXPECT_EQ(run.before.has_value(), has_truth(run.trial.kind));
    EXPECT_EQ(run.candidates.empty(), !has_truth(run.trial.kind));
  }
}

// Right is the truth followed by half a turn about y, the axis of the motorised probe; a pose that
// is not turned is off by the chord of half a turn, twice the distance from that axis.
TEST(RunTrials, AHalfTurnIsRightIfThePoseIsTurnedToo) {
  const std::vector<StudyCase> cases{small_case("a_1", 1)};
  StudyOptions options;
  options.kinds = {TrialKind::kHalfTurn};
  options.starts = 1;
  const auto run_with = [&](const Isometry3d& T_us_ct) {
    const Register finds = [&](const PreScanVolume&, const CtVolume&, const Isometry3d&) {
      RegistrationResult result;
      result.status = RegistrationStatus::kRegistered;
      result.T_us_ct = T_us_ct;
      return result;
    };
    return runs_of(cases, plan_trials(cases, options), finds)[0];
  };
  const Isometry3d turn(Eigen::AngleAxisd(kPi, Vector3d::UnitY()));
  const StudyRun right = run_with(turn * cases[0].T_us_ct_true);
  EXPECT_NEAR(right.after->rigid.max_mm, 0.0, 1e-6);
  EXPECT_NEAR(right.after->physical.max_mm, 0.0, 1e-6);
  const StudyRun unturned = run_with(cases[0].T_us_ct_true);
  EXPECT_NEAR(unturned.after->rigid.per_target_mm[1], 2.0 * std::hypot(30.0, 5.0), 1e-6);
  EXPECT_NEAR(unturned.after->physical.per_target_mm[1], 2.0 * std::hypot(30.0, 5.0), 1e-6);
  EXPECT_EQ(negative_statistics({right, unturned})[0].accepted_right, 1U);
}

TEST(RunTrials, RegistersTheAlteredCt) {
  const std::vector<StudyCase> cases{small_case("a_1", 1)};
  StudyOptions options;
  options.kinds = {TrialKind::kStart, TrialKind::kCtMirrored, TrialKind::kCtAxesSwapped};
  options.starts = 1;
  std::vector<double> handedness;
  const Register notes = [&](const PreScanVolume&, const CtVolume& ct, const Isometry3d&) {
    handedness.push_back(ct.grid.direction.determinant());
    return RegistrationResult{};
  };
  const std::vector<StudyRun> runs =
      runs_of(cases, plan_trials(cases, options), notes, StudyThreads::kWithinTrial, 1);
  EXPECT_TRUE(runs[0].peak_memory_mib.has_value());
  ASSERT_EQ(handedness.size(), 3U);
  EXPECT_NEAR(handedness[0], 1.0, 1e-12);
  EXPECT_NEAR(handedness[1], -1.0, 1e-12);
  EXPECT_NEAR(handedness[2], -1.0, 1e-12);
}

// The first target was 3 mm deeper during the ultrasound than the rigid truth says, the others are
// where it says. From the truth itself, the error is that of this target alone.
TEST(RunTrials, ThePhysicalErrorIncludesTheDeformation) {
  StudyCase deformed = small_case("a_1", 1);
  deformed.targets_us_mm[0].y() += 3.0;
  StudyOptions options;
  options.starts = 1;
  options.max_displacement_mm = 0.0;
  const std::vector<StudyRun> runs =
      runs_of({deformed}, plan_trials({deformed}, options), register_nothing);
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
  expect_input_error([&] { runs_of(cases, plan_trials(cases, {}), fails); },
                     {"refuses its options"});
  expect_input_error(
      [&] { runs_of(cases, plan_trials(cases, {}), fails, StudyThreads::kOverTrials, 0); },
      {"threads"});
}

TEST(RunTrials, TheMemoryIsThatOfTheRegistration) {
  const std::vector<StudyCase> cases{small_case("a_1", 1)};
  StudyOptions options;
  options.starts = 2;
  const auto run_with = [&](std::size_t mib) {
    const Register holds = [mib](const PreScanVolume&, const CtVolume&, const Isometry3d&) {
      const std::vector<char> held(mib << 20U, 'x');
      RegistrationResult result;
      result.evaluations = std::count(held.begin(), held.end(), 'x') > 0 ? 1 : 0;
      return result;
    };
    return runs_of(cases, plan_trials(cases, options), holds, StudyThreads::kWithinTrial, 1)[1];
  };
  EXPECT_NEAR(*run_with(96).peak_memory_mib, 96.0, 8.0);
  EXPECT_NEAR(*run_with(16).peak_memory_mib, 16.0, 8.0);
  EXPECT_FALSE(runs_of(cases, plan_trials(cases, options), register_nothing)[0].peak_memory_mib);
}

TEST(StudyRun, SecondsAreTheTotalOrTheSumOfStages) {
  StudyRun run;
  run.result.seconds = {{"coarse", 1.5}, {"fine", 2.0}};
  EXPECT_DOUBLE_EQ(run.seconds(), 3.5);
  run.result.seconds["total"] = 4.0;
  EXPECT_DOUBLE_EQ(run.seconds(), 4.0);
}

TEST(StudyReport, TablesHoldTheStatistics) {
  const std::vector<StudyRun> runs{run_with_error("b", 1.0, 3.0, 2.0),
                                   run_with_error("b", 2.5, 12.0, 8.0),
                                   run_with_error("b", -1.0, 19.0, 3.0)};
  const std::string table = markdown(accuracy_table(runs, {0.0, 10.0, 20.0}));
  EXPECT_NE(table.find("| b | 3 | 1 | 1.75 / 1.75 / 1.06 | 1.75 / 1.75 / 1.06 | "
                       "2.75 / 2.75 / 3.50 | 33.3 | 66.7 | 66.7 | 2.50 | 3.00 | 100.0 of 1 | "
                       "50.0 of 2 |"),
            std::string::npos)
      << table;
  EXPECT_EQ(markdown(calibration_table(runs)), "No accepted run tells an expected error.\n");
  EXPECT_EQ(markdown(negatives_table(runs)), "");
}

TEST(StudyReport, ThesisTableIsPerCase) {
  const std::vector<StudyRun> runs{run_with_error("b", 1.0, 3.0, 2.0),
                                   run_with_error("b", 2.0, 3.0, 4.0),
                                   run_with_error("b", 9.0, 3.0, 6.0)};
  StudyPlan plan;
  plan.cases = {small_case("b_1", 1)};
  const std::string table = markdown(thesis_table(plan, in_memory(plan.cases), runs));
  EXPECT_NE(
      table.find("| b_1 | 3 | 66.7 | 1.50 | 0.71 | (24, 12, 6) | (4.00 mm, 2.86 deg, 5.73 deg) "
                 "| 4.00 |"),
      std::string::npos)
      << table;
}

TEST(StudyReport, ThesisTableTellsTheSizeOfWhatIsRegistered) {
  StudyPlan plan;
  plan.cases = {small_case("b_1", 1)};
  BeamOptions parallel;
  parallel.parallel_beams_mm = 8.0;
  const Grid grid = fan_grid(plan.cases[0].ultrasound.geometry, 8.0);
  const std::string table = markdown(
      thesis_table(plan, in_memory(plan.cases), {run_with_error("b", 1.0, 3.0, 2.0)}, parallel));
  EXPECT_NE(table.find("(" + std::to_string(grid.size.x()) + ", " + std::to_string(grid.size.y()) +
                       ", " + std::to_string(grid.size.z()) + ") | (8.00 mm, 8.00 mm, 8.00 mm)"),
            std::string::npos)
      << table;
}

TEST(StudyReport, NegativesAreCountedByStatus) {
  std::vector<StudyRun> runs{run_with_error("b", -1.0), run_with_error("b", 1.0)};
  for (StudyRun& run : runs) run.trial.kind = TrialKind::kMirrored;
  runs[1].after.reset();
  const std::string table = markdown(negatives_table(runs));
  // Not both of two trials happen in 5 % of all studies if p^2 = 0.95.
  EXPECT_NE(table.find("| mirrored | 2 | 1 (low_confidence 1) | - | 1 | 50.0, 97.47 |"),
            std::string::npos)
      << table;
}

TEST(StudyReport, JsonTellsEveryRunAndNullForWhatIsUnknown) {
  const std::vector<StudyCase> cases = small_cases();
  const std::vector<Trial> trials = plan_trials(cases, {});
  std::vector<StudyRun> runs = runs_of(cases, {trials[0], trials[9]}, register_nothing);
  runs[0].result.overlap = std::nan("");
  StudyPlan plan;
  plan.study.methods = {{"scan-converted", {}, 1.5}};
  plan.cases = {cases[0], small_stranger("s_1", 7)};
  StudyExtras extras;
  extras.profiles = {{"scan-converted", "a_1", {}}};
  extras.profiles[0].axes[3] = {{-0.1, 0.0, 0.1}, {0.5, 1.0, std::nan("")}};
  const TemporaryFolder folder;
  write_study_json(plan, runs, extras, folder.path() / "study.json");
  const auto json = nlohmann::json::parse(read_text(folder.path() / "study.json"));
  EXPECT_EQ(json["study"]["starts"]["seeds"], nlohmann::json({1}));
  EXPECT_EQ(json["study"]["methods"][0]["parallel_beams_mm"], 1.5);
  EXPECT_EQ(json["study"]["methods"][0]["options"]["seed"], "1");
  ASSERT_EQ(json["cases"].size(), 1U);
  const auto& a_1 = json["cases"][0];
  EXPECT_EQ(a_1["name"], "a_1");
  EXPECT_EQ(a_1["us_samples"], 24 * 12 * 6);
  EXPECT_EQ(a_1["ct_voxels"], 6 * 5 * 4);
  EXPECT_EQ(a_1["centre_us_mm"][1], cases[0].centre_us_mm().y());
  EXPECT_EQ(a_1["T_us_ct_true"][3], cases[0].T_us_ct_true(0, 3));
  const auto& about_x = json["profiles"][0]["axes"][3];
  EXPECT_EQ(about_x["offsets"], nlohmann::json({-0.1, 0.0, 0.1}));
  EXPECT_EQ(about_x["values"], nlohmann::json({0.5, 1.0, nullptr}));
  ASSERT_EQ(json["runs"].size(), 2U);
  const auto& first = json["runs"][0];
  EXPECT_EQ(first["case"], "a_1");
  EXPECT_EQ(first["kind"], "start");
  EXPECT_EQ(first["status"], status_name(runs[0].result.status));
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
