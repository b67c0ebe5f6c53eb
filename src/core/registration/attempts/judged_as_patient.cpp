#include "registration/attempts/judged_as_patient.h"

#include "registration/as_patient.h"
#include "registration/attempts/verdict.h"
#include "registration/evidence/doubts.h"

namespace usct::registration {
namespace {

/// The optimum that a pose leads to, which another search has found, before the optima of the
/// search of `patient`.
std::vector<Candidate> headed_by_own(const Candidate& pose, const std::vector<Candidate>& searched,
                                     const Attempt& patient) {
  const double rival_mm = patient.input.options.confidence.rival_mm;
  const Candidate own = optimum_near(patient.problem, pose.T_us_ct, rival_mm, patient.run);
  std::vector<Candidate> optima{own};
  for (const Candidate& found : searched) {
    if (patient.problem.field.distance_mm(found.T_us_ct, own.T_us_ct) > rival_mm)
      optima.push_back(found);
    else if (found.value > optima.front().value)
      optima.front() = found;  // the same optimum, climbed higher
  }
  return optima;
}

/// The search of `patient`, which is a part of the evidence here, also in the times of the steps.
struct PatientSearch {
  const Attempt& attempt;
  std::vector<Candidate> optima;
};

/// Completes the measures of a pose that so many rounds of another search have found by the
/// evidence of `patient`.
Assessment assessed(const PatientSearch& patient, const Candidate& pose, const Measures& measured,
                    int rounds) {
  const auto& [input, images, problem, run] = patient.attempt;
  Evidence evidence({input.ultrasound, input.ct.ct(), images, problem, input.options.confidence});
  const std::vector<Candidate> optima = headed_by_own(pose, patient.optima, patient.attempt);
  Assessment assessment;
  assessment.measures = measured;
  evidence.compare_further(optima, rounds, assessment, run);
  evidence.check(pose, assessment, run);
  evidence.settle(optima.front(), assessment, run);
  return assessment;
}

/// Refines and judges the best of the optima that so many rounds have found.
Outcome<Judged> refined_and_judged(const Attempt& attempt, const PatientSearch& patient,
                                   const std::vector<Candidate>& optima, int rounds) {
  const Outcome<Candidate> pose = refined(attempt, optima.front());
  if (!pose) return pose.refusal();
  Measures measured;
  measure_pose(attempt, optima.front(), *pose, measured);
  const Assessment assessment =
      attempt.run.timed("confidence", [&] { return assessed(patient, *pose, measured, rounds); });
  const GateLimits& gates = attempt.input.options.confidence.gates;
  return Judged{optima, *pose, assessment, judge(assessment.measures, gates)};
}

Outcome<Registration> in_rounds(const Attempt& attempt, const PatientSearch& patient) {
  const int rounds = attempt.input.options.search.rounds;
  std::vector<Candidate> optima;
  for (int round = 1;; ++round) {
    optima = searched(attempt, round - 1, std::move(optima));
    if (optima.empty()) return nothing_in_reach();
    const Outcome<Judged> best = refined_and_judged(attempt, patient, optima, round);
    if (!best) return best.refusal();
    attempt.run.report(static_cast<double>(round) / rounds);
    if (!best->failure || round == rounds || !may_be_missed(best->assessment.measures)) {
      Registration registration;
      registration.result = result_of(*best);
      return registration;
    }
  }
}

}  // namespace

Outcome<Registration> judged_as_patient(const Attempt& attempt) {
  constexpr double kSearched = 0.1;
  Run& run = attempt.run;
  std::optional<Run::Part> part(std::in_place, run, 0.0, kSearched);
  const RegistrationOptions options = as_patient(attempt.input.options);
  const RegistrationInput input = attempt.input.by(options);
  const Outcome<ImagePyramid> images = run.timed("confidence", [&] { return prepare(input, run); });
  if (!images) return images.refusal();
  const Attempt patient = attempt_on(*images, input, run);
  std::vector<Candidate> optima =
      run.timed("confidence", [&] { return multi_start(patient.problem, 0, {}, run); });
  part.reset();
  part.emplace(run, kSearched, 1.0);
  return in_rounds(attempt, {patient, std::move(optima)});
}

}  // namespace usct::registration
