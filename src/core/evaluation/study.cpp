#include "us_ct_registration/evaluation/study.h"

#include <omp.h>

#include "parallel.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

using Eigen::Isometry3d;

StudyRun evaluated(const std::vector<StudyCase>& cases, const Trial& trial,
                   RegistrationResult result) {
  const StudyCase& own = cases[trial.us_case];
  StudyRun run;
  run.trial = trial;
  run.case_name = own.name;
  run.group = own.group();
  run.ct_case_name = cases[trial.ct_case].name;
  run.result = std::move(result);
  const Isometry3d T_shown = T_shown_us(cases, trial);
  std::vector<Eigen::Vector3d> targets_us_mm;
  for (const Eigen::Vector3d& p_us : own.targets_us_mm) targets_us_mm.push_back(T_shown * p_us);
  const auto errors = [&](const Isometry3d& T_us_ct) {
    return PoseErrors{evaluate_targets(T_us_ct, T_shown * own.T_us_ct_true, targets_us_mm),
                      evaluate_matched_targets(T_us_ct, own.targets_ct_mm, targets_us_mm)};
  };
  if (run.accepted() && run.result.covariance)
    run.expected = expected_tre_mm(*run.result.covariance, targets_us_mm, own.name);
  if (!has_truth(trial.kind)) return run;
  run.before = errors(trial.T_us_ct_initial);
  if (run.accepted()) run.after = errors(*run.result.T_us_ct);
  for (const RegistrationCandidate& candidate : run.result.candidates)
    run.candidates.push_back(errors(candidate.T_us_ct));
  return run;
}

/// Sets the number of OpenMP threads within a scope. Loops within a parallel loop run on one
/// thread.
class ThreadCount {
 public:
  explicit ThreadCount(int threads)
      : threads_(omp_get_max_threads()), levels_(omp_get_max_active_levels()) {
    if (threads < 1)
      throw InputError("threads", "is " + std::to_string(threads) + ", must be >= 1");
    omp_set_num_threads(threads);
    omp_set_max_active_levels(1);
  }
  ~ThreadCount() {
    omp_set_num_threads(threads_);
    omp_set_max_active_levels(levels_);
  }
  ThreadCount(const ThreadCount&) = delete;
  ThreadCount& operator=(const ThreadCount&) = delete;

 private:
  int threads_;
  int levels_;
};

}  // namespace

double StudyRun::seconds() const {
  const auto total = result.seconds.find("total");
  if (total != result.seconds.end()) return total->second;
  double sum = 0.0;
  for (const auto& [stage, seconds] : result.seconds) sum += seconds;
  return sum;
}

std::vector<StudyRun> run_trials(const std::vector<StudyCase>& cases,
                                 const std::vector<Trial>& trials, const Register& register_one,
                                 StudyThreads how, int threads, const Progress& progress) {
  const ThreadCount thread_count(threads);
  std::vector<StudyRun> runs(trials.size());
  const auto run_one = [&](std::size_t i) {
    const Trial& trial = trials[i];
    const std::optional<CtVolume> altered = altered_ct(cases, trial);
    runs[i] = evaluated(
        cases, trial,
        register_one(trial_ultrasound(cases, trial), altered ? *altered : cases[trial.ct_case].ct,
                     trial.T_us_ct_initial));
  };
  if (how == StudyThreads::kOverTrials) {
    parallel_for(
        static_cast<int>(trials.size()), [&](int i) { run_one(static_cast<std::size_t>(i)); },
        progress);
    return runs;
  }
  for (std::size_t i = 0; i < trials.size(); ++i) {
    run_one(i);
    if (progress) progress(static_cast<double>(i + 1) / static_cast<double>(trials.size()));
  }
  return runs;
}

}  // namespace usct
