#include "registration/attempts/pose_judge.h"

#include "registration/evidence/doubts.h"

namespace usct::registration {

PoseJudge::PoseJudge(const Attempt& attempt)
    : attempt_(attempt),
      plan_(attempt.input.options.confidence),
      evidence_({attempt.input.ultrasound, attempt.input.ct.ct(), attempt.images, attempt.problem,
                 attempt.input.options.confidence}) {}

bool PoseJudge::blocks_agree(const Candidate& refined) {
  return attempt_.run.timed("confidence",
                            [&] { return evidence_.blocks_agree(refined, attempt_.run); });
}

Assessment PoseJudge::compared(const std::vector<Candidate>& optima,
                               const std::optional<int>& decoy_rounds) {
  Run& run = attempt_.run;
  Assessment assessment;
  assessment.measures.displacement_mm =
      attempt_.problem.field.distance_mm(optima.front().T_us_ct, attempt_.problem.T_us_ct_initial);
  if (plan_.gathers())
    run.timed("confidence", [&] {
      if (decoy_rounds)
        evidence_.compare_further(optima, *decoy_rounds, assessment, run);
      else
        evidence_.compare(optima, assessment, run);
    });
  return assessment;
}

bool PoseJudge::goes_on_as_patient(const Measures& measures) const {
  return plan_.may_go_on_as_patient() &&
         !is_beyond_doubt(measures, *attempt_.input.options.confidence.gates.max_wrong_probability);
}

bool PoseJudge::parts_could_save(const Assessment& compared) const {
  const Measures best = if_parts_agree(compared.measures);
  if (!best.wrong_probability) return true;
  return !goes_on_as_patient(best) && (plan_.accepts(best) || !may_be_missed(best));
}

Judged PoseJudge::judged(std::vector<Candidate> optima, Assessment compared,
                         const Candidate& refined) {
  Run& run = attempt_.run;
  Measures& measures = compared.measures;
  measure_pose(attempt_, optima.front(), refined, measures);
  if (plan_.gathers())
    run.timed("confidence", [&] {
      evidence_.check(refined, compared, run);
      // Evidence that takes long is not worth it for a pose in doubt if the registration goes on.
      if (!goes_on_as_patient(measures)) evidence_.settle(optima.front(), compared, run);
    });
  const std::optional<GateFailure> failure =
      judge(measures, attempt_.input.options.confidence.gates);
  return {std::move(optima), refined, std::move(compared), failure};
}

Judged PoseJudge::judged_where_it_led(std::vector<Candidate> optima, const Assessment& compared,
                                      const Candidate& refined) {
  const std::optional<Candidate> other = other_optimum(optima.front(), refined);
  if (!other) return judged(std::move(optima), compared, refined);
  return judged_beside_more(headed_by(*other, optima, attempt_.problem), refined, 1);
}

Judged PoseJudge::judged_beside_more(std::vector<Candidate> optima, const Candidate& refined,
                                     int rounds) {
  Assessment beside_more = compared(optima, rounds);
  return judged(std::move(optima), std::move(beside_more), refined);
}

Outcome<Judged> PoseJudge::refined_and_judged(const std::vector<Candidate>& optima,
                                              const Assessment& compared, int rounds) {
  const Outcome<Candidate> pose = refined(attempt_, optima.front());
  if (!pose) return pose.refusal();
  Judged best = judged_where_it_led(optima, compared, *pose);
  // More starts than the decoys had may have found a wrong pose that is better than they are.
  if (!best.failure && rounds > 1) return judged_beside_more(std::move(best.optima), *pose, rounds);
  return best;
}

Judged PoseJudge::follow_wished_motion(Judged refused, int rounds) {
  constexpr int kMostSteps = 3;
  for (int step = 0; step < kMostSteps && refused.failure; ++step) {
    std::optional<Judged> next = one_step_on(refused, rounds);
    if (!next) break;
    refused = *std::move(next);
  }
  return refused;
}

std::optional<Judged> PoseJudge::one_step_on(const Judged& refused, int rounds) {
  const std::optional<Candidate> optimum = wished_optimum(refused);
  if (!optimum) return std::nullopt;
  const Outcome<Candidate> pose = refined(attempt_, *optimum);
  if (!pose || !is_another_pose(pose->T_us_ct, refused)) return std::nullopt;
  std::vector<Candidate> optima = headed_by(*optimum, refused.optima, attempt_.problem);
  Assessment at_optimum = compared(optima);
  Judged next = judged(std::move(optima), std::move(at_optimum), *pose);
  if (!(next.assessment.measures.local_agreement > refused.assessment.measures.local_agreement))
    return std::nullopt;
  // The decoys have not climbed from there yet.
  if (!next.failure) return judged_beside_more(std::move(next.optima), *pose, rounds);
  return next;
}

bool PoseJudge::has_left(const Candidate& optimum, const Candidate& refined) const {
  return attempt_.problem.field.are_apart(optimum.T_us_ct, refined.T_us_ct,
                                          attempt_.problem.options.distinct_mm);
}

bool PoseJudge::is_believed(const Judged& judged) const {
  return !judged.failure && !goes_on_as_patient(judged.assessment.measures);
}

std::optional<Candidate> PoseJudge::other_optimum(const Candidate& optimum,
                                                  const Candidate& refined) const {
  if (!plan_.gathers() || !has_left(optimum, refined)) return std::nullopt;
  const std::optional<Candidate> reached = optimum_from(attempt_, refined.T_us_ct);
  if (!reached || !has_left(optimum, *reached)) return std::nullopt;
  return reached;
}

bool PoseJudge::is_another_pose(const Eigen::Isometry3d& T_us_ct, const Judged& judged) const {
  constexpr double kLeastMm = 1.0;
  return attempt_.problem.field.are_apart(T_us_ct, judged.refined.T_us_ct, kLeastMm);
}

std::optional<Candidate> PoseJudge::wished_optimum(const Judged& judged) const {
  const Assessment& assessment = judged.assessment;
  if (!assessment.wished_motion || !may_be_near(assessment.measures)) return std::nullopt;
  const Eigen::Isometry3d T_wished = *assessment.wished_motion * judged.refined.T_us_ct;
  if (!is_another_pose(T_wished, judged)) return std::nullopt;
  const std::optional<Candidate> reached = optimum_from(attempt_, T_wished);
  if (!reached || !is_another_pose(reached->T_us_ct, judged)) return std::nullopt;
  return reached;
}

}  // namespace usct::registration
