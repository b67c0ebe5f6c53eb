#include "registration/attempts/rounds.h"

#include <algorithm>

#include "registration/attempts/pose_judge.h"
#include "registration/attempts/verdict.h"
#include "registration/evidence/doubts.h"
#include "registration/search/block_search.h"

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

/// The registration that ends with this pose, and the trail from it.
Registration ended(const Attempt& attempt, const PoseJudge& judge, const Judged& judged) {
  Registration registration;
  registration.result = result_of(judged);
  if (!judged.failure && judge.decoys())
    registration.trail = Trail{
        judged.refined.T_us_ct,
        *judge.decoys(),
        rivals_of(judged.optima, attempt.input.options.confidence.rival_mm, attempt.problem.field),
        {}};
  return registration;
}

/// The pose of one round of the search from matched blocks, whether it is believed or not; none if
/// blocks cannot be matched, or blocks of the field agree so little about it that it cannot be
/// believed. It leaves no trail: tracking climbs by the similarity of the other search.
std::optional<Registration> by_matched_blocks(const Attempt& of) {
  if (!EvidencePlan(of.input.options.confidence).gathers()) return std::nullopt;
  const std::unique_ptr<const BlockSearch> search = block_search(of.input, of.images);
  if (!search) return std::nullopt;
  const Attempt attempt{of.input, of.images, search->problem(), of.run};
  PoseJudge judge(attempt);
  const std::vector<Candidate> optima = searched(attempt, 0, {});
  if (optima.empty() || !optima.front().has_value()) return std::nullopt;
  const Outcome<Candidate> pose = refined(attempt, optima.front());
  if (!pose || !judge.blocks_agree(*pose)) return std::nullopt;
  Judged best = judge.judged_where_it_led(optima, judge.compared(optima), *pose);
  best = judge.follow_wished_motion(std::move(best), 1);
  Registration registration;
  registration.result = result_of(best);
  registration.by_matched_blocks = true;
  return registration;
}

}  // namespace

Outcome<Registration> in_rounds(const Attempt& attempt) {
  const int rounds = attempt.input.options.search.rounds;
  PoseJudge judge(attempt);
  std::vector<Candidate> optima;
  std::vector<Eigen::Isometry3d> refused;
  std::optional<Registration> matched;
  for (int round = 0;; ++round) {
    if (round == 1) {
      matched = by_matched_blocks(attempt);
      if (matched && is_registered(*matched)) return *std::move(matched);
    }
    optima = searched(attempt, round, std::move(optima));
    if (optima.empty()) return nothing_in_reach();
    attempt.run.report((round + 0.5) / rounds);
    const bool is_last = round + 1 == rounds;
    const Eigen::Isometry3d T_best = optima.front().T_us_ct;
    const bool was_refused = contains(refused, T_best);
    // Judged again, it would be refused again.
    if (!is_last && was_refused) continue;
    const Assessment compared = judge.compared(optima);
    if (!is_last && !judge.parts_could_save(compared)) continue;
    Outcome<Judged> best = judge.refined_and_judged(optima, compared, round + 1);
    if (!best) return best.refusal();
    if (!was_refused) *best = judge.follow_wished_motion(*std::move(best), round + 1);
    optima = best->optima;
    refused.insert(refused.end(), {T_best, optima.front().T_us_ct});
    attempt.run.report((round + 1.0) / rounds);
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
  const Assessment compared = judge.compared(optima);
  attempt.run.report(0.5);
  if (!judge.parts_could_save(compared)) return std::nullopt;
  const Outcome<Judged> best = judge.refined_and_judged(optima, compared, 1);
  if (!best || !judge.is_believed(*best)) return std::nullopt;
  return ended(attempt, judge, *best);
}

}  // namespace usct::registration
