#include "registration/attempts/tracked.h"

#include "registration/attempts/pose_judge.h"
#include "registration/attempts/verdict.h"
#include "registration/search/refinement.h"

namespace usct::registration {

std::optional<Registration> tracked(const Attempt& attempt, const Lead& lead) {
  const RegistrationInput& in = attempt.input;
  if (attempt.problem.field.are_apart(attempt.problem.T_us_ct_initial, lead.trail.T_us_ct,
                                      lead.reach_mm))
    return std::nullopt;
  std::optional<Followed> followed = attempt.run.timed("tracking", [&] {
    return follow(lead.trail, attempt.problem, attempt.images.prepared.us->beams,
                  in.options.confidence, attempt.run);
  });
  if (!followed) return std::nullopt;
  const std::vector<Candidate>& optima = followed->optima;
  PoseJudge judge(attempt);
  judge.take_over(std::move(followed->decoys));
  const Assessment compared = judge.compare(optima);
  const Outcome<Candidate> refined =
      refine(attempt.images, in.ct, optima.front(), in.options, attempt.run);
  if (!refined || judge.has_left(optima.front(), *refined)) return std::nullopt;
  const Judged judged = judge.judge(optima, compared, *refined);
  if (!judge.is_believed(judged)) return std::nullopt;
  Registration registration;
  registration.result = result_of(judged);
  registration.was_tracked = true;
  return registration;
}

}  // namespace usct::registration
