#include "us_ct_registration/evaluation/study_run.h"

#include <mutex>

#include "evaluation/peak_memory.h"
#include "parallel.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

using Eigen::Isometry3d;

StudyRun evaluated(const StudyCase& own, const StudyCase& ct_case, const Trial& trial,
                   RegistrationResult result) {
  StudyRun run;
  run.trial = trial;
  run.case_name = own.name;
  run.group = own.group();
  run.ct_case_name = ct_case.name;
  run.result = std::move(result);
  const Isometry3d T_shown = T_shown_us(own, trial);
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

StudyRun run_one(const CaseSource& cases, const RunOrder& order, bool alone) {
  const Trial& trial = *order.trial;
  const std::shared_ptr<const StudyCase> own = cases(trial.us_case);
  const std::shared_ptr<const StudyCase> ct_case = cases(trial.ct_case);
  const PreScanVolume ultrasound = trial_ultrasound(*own, trial);
  const std::optional<CtVolume> altered = altered_ct(*ct_case, trial);
  std::optional<PeakMemory> memory;
  if (alone) memory.emplace();
  RegistrationResult result =
      (*order.register_one)(ultrasound, altered ? *altered : ct_case->ct, trial.T_us_ct_initial);
  const std::optional<double> peak_mib = memory ? memory->mib() : std::nullopt;
  StudyRun run = evaluated(*own, *ct_case, trial, std::move(result));
  run.peak_memory_mib = peak_mib;
  return run;
}

}  // namespace

double StudyRun::seconds() const {
  const auto total = result.seconds.find("total");
  if (total != result.seconds.end()) return total->second;
  double sum = 0.0;
  for (const auto& [stage, seconds] : result.seconds) sum += seconds;
  return sum;
}

void run_trials(const CaseSource& cases, const std::vector<RunOrder>& orders, StudyThreads how,
                int threads, const std::function<void(std::size_t, StudyRun&&)>& done) {
  const ThreadCount in_all(threads);
  if (how == StudyThreads::kWithinTrial) {
    for (std::size_t i = 0; i < orders.size(); ++i) done(i, run_one(cases, orders[i], true));
    return;
  }
  std::mutex handing_over;
  parallel_for(static_cast<int>(orders.size()), [&](int order) {
    const auto i = static_cast<std::size_t>(order);
    StudyRun run = run_one(cases, orders[i], false);
    const std::lock_guard<std::mutex> lock(handing_over);
    done(i, std::move(run));
  });
}

}  // namespace usct
