#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/evaluation/trials.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/progress.h"
#include "us_ct_registration/registration/registration_result.h"

/// A study: many registrations of cases with known truth, and their errors. study_statistics.h and
/// study_report.h make tables of it.
namespace usct {

/// Errors of one pose at the targets of a case.
struct PoseErrors {
  /// Against the truth of the case, which is the best rigid fit of its targets.
  TargetErrors rigid;
  /// Distances of the targets themselves. Where the kidney deformed they include what no rigid pose
  /// can remove; where it did not, or nothing is known of it, they equal `rigid`.
  TargetErrors physical;
};

/// A trial and its result.
struct StudyRun {
  Trial trial;
  std::string case_name;
  std::string group;
  std::string ct_case_name;
  RegistrationResult result;
  /// Errors at the start, of the pose if it was accepted, and of every candidate; none without
  /// truth.
  std::optional<PoseErrors> before;
  std::optional<PoseErrors> after;
  std::vector<PoseErrors> candidates;
  /// Errors that the covariance of an accepted result predicts.
  std::optional<ExpectedTargetErrors> expected;

  bool accepted() const { return result.T_us_ct.has_value(); }
  /// Wall time of the registration without files: the "total" of the result if it has one, else the
  /// sum of its steps.
  double seconds() const;
};

using Register = std::function<RegistrationResult(const PreScanVolume&, const CtVolume&,
                                                  const Eigen::Isometry3d& T_us_ct_initial)>;

enum class StudyThreads {
  kOverTrials,   // each registration on one thread: most registrations per hour
  kWithinTrial,  // one registration after the other, each on all threads: comparable times
};

/// Runs all trials on `threads` threads (>= 1). The runs have the order of the trials and, if
/// `register_one` is a pure function, do not depend on the number of threads except for their
/// times. An exception of `register_one` ends the study.
std::vector<StudyRun> run_trials(const std::vector<StudyCase>& cases,
                                 const std::vector<Trial>& trials, const Register& register_one,
                                 StudyThreads how, int threads, const Progress& progress = {});

}  // namespace usct
