#include "registration/attempts/rounds.h"

#include <algorithm>

#include "registration/attempts/pose_judge.h"
#include "registration/attempts/verdict.h"
#include "registration/evidence/doubts.h"
#include "registration/search/block_search.h"
#include "registration/search/refinement.h"

namespace usct::registration {
namespace {

bool contains(const std::vector<Eigen::Isometry3d>& poses, const Eigen::Isometry3d& pose) {
  return std::any_of(poses.begin(), poses.end(),
                     [&](const Eigen::Isometry3d& other) { return other.isApprox(pose, 0.0); });
}

bool is_registered(const Registration& registration) {
  return registration.result.status == RegistrationStatus::kRegistered;
}

/// The one that is less likely to be wrong.
Registration likelier(Registration one, std::optional<Registration> other) {
  const auto wrong = [](const Registration& of) {
    return of.result.measures.wrong_probability.value_or(1.0);
  };
  return other && wrong(*other) < wrong(one) ? *std::move(other) : std::move(one);
}

Outcome<Candidate> refined_best(const Attempt& attempt, const std::vector<Candidate>& optima) {
  const RegistrationInput& in = attempt.input;
  return refine(attempt.images, in.ct, optima.front(), in.options, attempt.run);
}

/// The registration that ends with this pose, and the trail from it.
Registration ended(const Attempt& attempt, const PoseJudge& judge, const Judged& judged) {
  Registration registration;
  registration.result = result_of(judged);
  if (!judged.failure && judge.plan().gathers() && judge.decoys())
    registration.trail = Trail{
        judged.refined.T_us_ct,
        *judge.decoys(),
        rivals_of(judged.optima, attempt.input.options.confidence.rival_mm, attempt.problem.field),
        {}};
  return registration;
}

/// The pose of one round of the search from matched blocks, whether it is believed or not; none if
/// blocks cannot be matched, or clusters of the field agree so little about it that it cannot be
/// believed.
std::optional<Registration> by_matched_blocks(const Attempt& of) {
  if (!EvidencePlan(of.input.options.confidence).gathers()) return std::nullopt;
  const std::unique_ptr<const BlockSearch> search = block_search(of.input, of.images);
  if (!search) return std::nullopt;
  const Attempt attempt{of.input, of.images, search->problem(), of.run};
  PoseJudge judge(attempt);
  const std::vector<Candidate> optima = searched(attempt, 0, {});
  if (optima.empty() || !optima.front().has_value()) return std::nullopt;
  const Outcome<Candidate> refined = refined_best(attempt, optima);
  if (!refined || !judge.clusters_agree(*refined)) return std::nullopt;
  Judged best = judge.judge_where_it_led(optima, judge.compare(optima), *refined);
  best = judge.follow_wished_motion(std::move(best), 1);
  Registration registration = ended(attempt, judge, best);
  registration.by_matched_blocks = true;
  registration.trail.reset();  // tracking climbs by the similarity of the other search
  return registration;
}

/// The best optimum, which so many rounds have found, after its refinement.
Outcome<Judged> refined_and_judged(const Attempt& attempt, PoseJudge& judge,
                                   const std::vector<Candidate>& optima, const Assessment& compared,
                                   int rounds) {
  const Outcome<Candidate> refined = refined_best(attempt, optima);
  if (!refined) return refined.refusal();
  Judged best = judge.judge_where_it_led(optima, compared, *refined);
  // More starts than the decoys had may have found a wrong pose that is better than they are.
  if (!best.failure && rounds > 1)
    return judge.judge_beside_more(std::move(best.optima), *refined, rounds);
  return best;
}

}  // namespace

Outcome<Registration> in_rounds(const Attempt& attempt) {
  const int rounds = attempt.input.options.search.rounds;
  PoseJudge judge(attempt);
  std::vector<Candidate> optima;
  std::vector<Eigen::Isometry3d> refused;
  std::optional<Registration> matched;
  for (int round = 0;; ++round) {
    if (round == 1) matched = by_matched_blocks(attempt);
    if (matched && is_registered(*matched)) return *std::move(matched);
    optima = searched(attempt, round, std::move(optima));
    if (optima.empty()) return nothing_in_reach();
    attempt.run.report(0.2 + 0.8 * (round + 0.5) / rounds);
    const bool is_last = round + 1 == rounds;
    const Eigen::Isometry3d T_best = optima.front().T_us_ct;
    const bool was_refused = contains(refused, T_best);
    // Judged again, it would be refused again.
    if (!is_last && was_refused) continue;
    const Assessment compared = judge.compare(optima);
    if (!is_last && !judge.parts_could_save(compared)) continue;
    Outcome<Judged> best = refined_and_judged(attempt, judge, optima, compared, round + 1);
    if (!best) return best.refusal();
    if (!was_refused) *best = judge.follow_wished_motion(*std::move(best), round + 1);
    optima = best->optima;
    refused.insert(refused.end(), {T_best, optima.front().T_us_ct});
    attempt.run.report(0.2 + 0.8 * (round + 1) / rounds);
    if (!best->failure) return ended(attempt, judge, *best);
    if (is_last || !may_be_missed(best->assessment.measures)) {
      // The climbs have missed a nearly symmetric kidney that they found in mirrored ultrasound.
      if (round == 0 && fits_mirrored(best->assessment.measures))
        matched = by_matched_blocks(attempt);
      return likelier(ended(attempt, judge, *best), std::move(matched));
    }
  }
}

std::optional<Registration> at_once(const Attempt& attempt) {
  PoseJudge judge(attempt);
  const std::vector<Candidate> optima = searched(attempt, 0, {});
  if (optima.empty()) return std::nullopt;
  const Assessment compared = judge.compare(optima);
  attempt.run.report(0.6);
  if (!judge.parts_could_save(compared)) return std::nullopt;
  const Outcome<Judged> best = refined_and_judged(attempt, judge, optima, compared, 1);
  if (!best || !judge.is_believed(*best)) return std::nullopt;
  return ended(attempt, judge, *best);
}

}  // namespace usct::registration
