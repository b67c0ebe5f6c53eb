#pragma once

#include <string>
#include <vector>

#include "us_ct_registration/evaluation/study_run.h"
#include "us_ct_registration/geometry/monotonic_table.h"

namespace usct::test {

/// A case too small to register: 24 x 12 x 6 samples in no particular pattern, around a CT of a few
/// voxels; poses and targets differ by `number`.
inline StudyCase small_case(const std::string& name, int number) {
  StudyCase study_case;
  study_case.name = name;
  Grid grid;
  grid.size = {6, 5, 4};
  grid.spacing_mm = {10.0, 12.0, 15.0};
  grid.origin_mm = {-100.0, 20.0, 300.0};
  study_case.ct = CtVolume(grid, static_cast<std::int16_t>(number));
  ScanGeometry& geometry = study_case.ultrasound.geometry;
  geometry.axial = {24, 2.0, 4.0};
  geometry.array = CurvilinearArray{40.0, centred_table(12, 0.05)};
  geometry.motion = MotorSweep{27.25, centred_table(6, 0.1), 0.0};
  for (int i = 0; i < 24 * 12 * 6; ++i)
    study_case.ultrasound.voxels.push_back(static_cast<std::uint8_t>((i * 37 + number * 11) % 200));
  study_case.T_us_ct_true.linear() =
      Eigen::AngleAxisd(0.3 + number, Eigen::Vector3d(1, 2, 3).normalized()).matrix();
  study_case.T_us_ct_true.translation() = Eigen::Vector3d(5.0 * number, 60.0, -200.0);
  study_case.targets_us_mm = {{0, 60, 0}, {30, 70, 5}, {-25, 65, 10.0 + number}, {5, 90, -20}};
  study_case.targets_ct_mm = ct_points_mm(study_case.T_us_ct_true, study_case.targets_us_mm);
  return study_case;
}

/// A case of which only the CT is used.
inline StudyCase small_stranger(const std::string& name, int number) {
  StudyCase stranger;
  stranger.name = name;
  stranger.is_stranger = true;
  stranger.ct = small_case(name, number).ct;
  stranger.targets_ct_mm = small_case(name, number).targets_ct_mm;
  return stranger;
}

/// Two groups: a_1, a_2, a_3 and b_1, b_2.
inline std::vector<StudyCase> small_cases() {
  return {small_case("a_1", 1), small_case("a_2", 2), small_case("b_1", 3), small_case("a_3", 4),
          small_case("b_2", 5)};
}

/// The cases as a study gets them.
inline CaseSource in_memory(const std::vector<StudyCase>& cases) {
  const auto shared = std::make_shared<const std::vector<StudyCase>>(cases);
  return
      [shared](std::size_t i) { return std::shared_ptr<const StudyCase>(shared, &shared->at(i)); };
}

/// The runs of all trials, in their order.
inline std::vector<StudyRun> runs_of(const std::vector<StudyCase>& cases,
                                     const std::vector<Trial>& trials, const Register& register_one,
                                     StudyThreads how = StudyThreads::kOverTrials,
                                     int threads = 2) {
  std::vector<RunOrder> orders;
  for (const Trial& trial : trials) orders.push_back({&trial, &register_one});
  std::vector<StudyRun> runs(trials.size());
  run_trials(in_memory(cases), orders, how, threads,
             [&](std::size_t i, StudyRun&& run) { runs[i] = std::move(run); });
  return runs;
}

/// Returns the start as the result; refuses if it rotates the CT by 2 rad or more.
inline RegistrationResult register_nothing(const PreScanVolume& ultrasound, const CtVolume& ct,
                                           const Eigen::Isometry3d& T_us_ct_initial) {
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

/// A run of a case of group `group`, accepted with a result that is off by `error_mm` along x, or
/// refused if that is negative. The physical error is 1 mm larger.
inline StudyRun run_with_error(const std::string& group, double error_mm,
                               double displacement_mm = 0.0, double seconds = 1.0) {
  StudyRun run;
  run.group = group;
  run.case_name = group + "_1";
  run.trial.displacement_mm = displacement_mm;
  run.result.seconds = {{"all", seconds}};
  run.result.status = RegistrationStatus::kLowConfidence;
  if (error_mm < 0.0) return run;
  run.result.status = RegistrationStatus::kRegistered;
  run.result.T_us_ct = Eigen::Isometry3d(Eigen::Translation3d(error_mm, 0, 0));
  const std::vector<Eigen::Vector3d> targets{{0, 0, 0}, {9, 9, 9}};
  run.after =
      PoseErrors{evaluate_targets(*run.result.T_us_ct, Eigen::Isometry3d::Identity(), targets),
                 evaluate_matched_targets(*run.result.T_us_ct, {{1, 0, 0}, {10, 9, 9}}, targets)};
  return run;
}

}  // namespace usct::test
