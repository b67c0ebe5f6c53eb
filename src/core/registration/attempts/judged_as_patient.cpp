#include "registration/attempts/judged_as_patient.h"

#include "registration/as_patient.h"
#include "registration/attempts/judged.h"
#include "registration/attempts/verdict.h"
#include "registration/search/refinement.h"

namespace usct::registration {
namespace {

/// The optima of the search of `patient`, first the one that a pose leads to which another search
/// has found.
std::vector<Candidate> optima_around(const Candidate& refined, const Attempt& patient) {
  const FieldPoints& field = patient.problem.field;
  const double rival_mm = patient.input.options.confidence.rival_mm;
  const std::vector<Candidate> searched = multi_start(patient.problem, 0, {}, patient.run);
  const Candidate own = optimum_near(patient.problem, refined.T_us_ct, rival_mm, patient.run);
  std::vector<Candidate> optima{own};
  for (const Candidate& found : searched) {
    if (field.distance_mm(found.T_us_ct, own.T_us_ct) > rival_mm)
      optima.push_back(found);
    else if (found.value > optima.front().value)
      optima.front() = found;  // the same optimum, climbed higher
  }
  return optima;
}

/// Completes the measures of a pose that so many rounds of another search have found by the
/// evidence of `patient`.
Outcome<Assessment> assessed_as_patient(const RegistrationInput& other, const Candidate& refined,
                                        const Measures& measured, int rounds, Run& run) {
  const RegistrationOptions options = as_patient(other.options);
  const RegistrationInput input{other.ultrasound, other.ct, other.T_us_ct_initial, options};
  const Outcome<ImagePyramid> images = prepare(input, run);
  if (!images) return images.refusal();
  const SearchProblem problem = problem_of(input, *images);
  Evidence evidence({input.ultrasound, input.ct.ct(), *images, problem, input.options.confidence});
  evidence.search_decoys_further(rounds);
  const std::vector<Candidate> optima = optima_around(refined, {input, *images, problem, run});
  Assessment assessment;
  assessment.measures = measured;
  evidence.compare(optima, assessment, run);
  evidence.check(refined, assessment, run);
  evidence.settle(optima.front(), assessment, run);
  return assessment;
}

}  // namespace

Outcome<Registration> judged_as_patient(const Attempt& attempt) {
  const RegistrationInput& in = attempt.input;
  const int rounds = in.options.search.rounds;
  std::vector<Candidate> optima;
  for (int round = 0; round < rounds; ++round) optima = searched(attempt, round, std::move(optima));
  if (optima.empty()) return nothing_in_reach();
  attempt.run.report(0.6);
  const Outcome<Candidate> refined =
      refine(attempt.images, in.ct, optima.front(), in.options, attempt.run);
  if (!refined) return refined.refusal();
  Measures measures;
  measure_pose(attempt.problem.field, in.T_us_ct_initial, optima.front(), *refined, measures);
  const Outcome<Assessment> assessment = attempt.run.timed("confidence", [&] {
    return assessed_as_patient(in, *refined, measures, rounds, attempt.run);
  });
  if (!assessment) return assessment.refusal();
  const std::optional<GateFailure> failure =
      judge(assessment->measures, in.options.confidence.gates);
  Registration registration;
  registration.result = result_of({optima, *refined, *assessment, failure});
  return registration;
}

}  // namespace usct::registration
