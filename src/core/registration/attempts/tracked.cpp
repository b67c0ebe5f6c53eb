#include "registration/attempts/tracked.h"

#include "registration/attempts/pose_judge.h"
#include "registration/attempts/verdict.h"

namespace usct::registration {

std::optional<Registration> tracked(const Attempt& attempt, const Lead& lead) {
  if (attempt.problem.field.are_apart(attempt.problem.T_us_ct_initial, lead.trail.T_us_ct,
                                      lead.reach_mm))
    return std::nullopt;
  std::optional<Followed> followed = attempt.run.timed("tracking", [&] {
    return follow(lead.trail, attempt.problem, attempt.images.prepared.us->beams,
                  attempt.input.options.confidence, attempt.run);
  });
  if (!followed) return std::nullopt;
  const std::vector<Candidate>& optima = followed->optima;
  PoseJudge judge(attempt);
  judge.take_over(std::move(followed->decoys));
  const Assessment compared = judge.compared(optima);
  const Outcome<Candidate> pose = refined(attempt, optima.front());
  if (!pose || judge.has_left(optima.front(), *pose)) return std::nullopt;
  const Judged judged = judge.judged(optima, compared, *pose);
  if (!judge.is_believed(judged)) return std::nullopt;
  Registration registration;
  registration.result = result_of(judged);
  registration.was_tracked = true;
  return registration;
}

}  // namespace usct::registration
