#include "registration/attempt.h"

#include <algorithm>

#include "registration/evidence/doubts.h"
#include "registration/search/block_search.h"
#include "registration/search/refinement.h"
#include "registration/verdict.h"

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

}  // namespace

Attempt::Attempt(const RegistrationInput& input, const ImagePyramid& images, Run& run)
    : Attempt(input, images,
              {images.similarities(), input.options.search, input.T_us_ct_initial,
               images.prepared.field, input.options.seed},
              run) {}

Attempt::Attempt(const RegistrationInput& input, const ImagePyramid& images,
                 const SearchProblem& search, Run& run)
    : in_(input), images_(images), run_(run), plan_(input.options.confidence), problem_(search) {}

std::vector<Candidate> Attempt::searched(int round, std::vector<Candidate> found) {
  return run_.timed("search", [&] { return multi_start(problem_, round, std::move(found), run_); });
}

Assessment Attempt::compared(Assessor& assessor, const std::vector<Candidate>& optima) {
  return run_.timed("confidence", [&] { return assessor.compare(optima, run_); });
}

bool Attempt::has_left(const Candidate& optimum, const Candidate& refined) const {
  return problem_.field.are_apart(optimum.T_us_ct, refined.T_us_ct, in_.options.search.distinct_mm);
}

std::optional<Candidate> Attempt::other_optimum(const Candidate& optimum,
                                                const Candidate& refined) {
  if (!plan_.gathers_own() || !has_left(optimum, refined)) return std::nullopt;
  const Candidate reached = run_.timed("search", [&] {
    return optimum_near(problem_, refined.T_us_ct, in_.options.confidence.rival_mm, run_);
  });
  if (!reached.has_value() || !has_left(optimum, reached)) return std::nullopt;
  return reached;
}

Outcome<Attempt::Judged> Attempt::refine_and_judge(Assessor& assessor,
                                                   std::vector<Candidate>& optima,
                                                   const Assessment& compared, int rounds) {
  const Outcome<Candidate> refined = refine(images_, in_.ct, optima.front(), in_.options, run_);
  if (!refined) return refined.refusal();
  Outcome<Judged> best = judge_where_it_led(assessor, optima, compared, *refined);
  // More starts than the decoys had may have found a wrong pose that is better than they are.
  if (best && !best->failure && rounds > 1)
    return judge_beside_more(assessor, optima, *refined, rounds);
  return best;
}

Outcome<Attempt::Judged> Attempt::judge_where_it_led(Assessor& assessor,
                                                     std::vector<Candidate>& optima,
                                                     const Assessment& compared,
                                                     const Candidate& refined) {
  const std::optional<Candidate> other = other_optimum(optima.front(), refined);
  if (!other) return judge_refined(assessor, optima, compared, refined);
  optima = headed_by(*other, optima, problem_);
  return judge_beside_more(assessor, optima, refined, 1);
}

Outcome<Attempt::Judged> Attempt::judge_refined(Assessor& assessor,
                                                const std::vector<Candidate>& optima,
                                                const Assessment& compared,
                                                const Candidate& refined) {
  const Outcome<Assessment> assessment =
      run_.timed("confidence", [&] { return assessor.assess(compared, optima, refined, run_); });
  if (!assessment) return assessment.refusal();
  return Judged{refined, *assessment, judge(assessment->measures, in_.options.confidence.gates)};
}

Outcome<Attempt::Judged> Attempt::judge_beside_more(Assessor& assessor,
                                                    const std::vector<Candidate>& optima,
                                                    const Candidate& refined, int rounds) {
  assessor.search_decoys_further(rounds);
  return judge_refined(assessor, optima, compared(assessor, optima), refined);
}

bool Attempt::is_another_pose(const Eigen::Isometry3d& T_us_ct, const Judged& judged) const {
  constexpr double kLeastMm = 1.0;
  return problem_.field.are_apart(T_us_ct, judged.refined.T_us_ct, kLeastMm);
}

std::optional<Candidate> Attempt::wished_optimum(const Judged& judged) {
  const Assessment& assessment = judged.assessment;
  if (!plan_.gathers_own() || !assessment.wished_motion || !may_be_near(assessment.measures))
    return std::nullopt;
  const Eigen::Isometry3d T_wished = *assessment.wished_motion * judged.refined.T_us_ct;
  if (!is_another_pose(T_wished, judged)) return std::nullopt;
  const Candidate reached = run_.timed("search", [&] {
    return optimum_near(problem_, T_wished, in_.options.confidence.rival_mm, run_);
  });
  if (!reached.has_value() || !is_another_pose(reached.T_us_ct, judged)) return std::nullopt;
  return reached;
}

void Attempt::follow_blocks(Assessor& assessor, std::vector<Candidate>& optima, Judged& best,
                            int rounds) {
  constexpr int kMostSteps = 3;
  for (int step = 0; step < kMostSteps && best.failure; ++step) {
    const std::optional<Candidate> optimum = wished_optimum(best);
    if (!optimum) return;
    const Outcome<Candidate> refined = refine(images_, in_.ct, *optimum, in_.options, run_);
    if (!refined || !is_another_pose(refined->T_us_ct, best)) return;
    std::vector<Candidate> followed = headed_by(*optimum, optima, problem_);
    Outcome<Judged> judged =
        judge_refined(assessor, followed, compared(assessor, followed), *refined);
    if (!judged ||
        !(judged->assessment.measures.local_agreement > best.assessment.measures.local_agreement))
      return;
    // The decoys have not climbed from there yet.
    if (!judged->failure) judged = judge_beside_more(assessor, followed, *refined, rounds);
    if (!judged) return;
    best = *judged;
    optima = std::move(followed);
  }
}

bool Attempt::is_believed(const Judged& judged) const {
  return !judged.failure && !plan_.goes_on_as_patient(judged.assessment.measures);
}

Registration Attempt::ended(const Assessor& assessor, const std::vector<Candidate>& optima,
                            const Judged& judged) const {
  Registration registration{result_of(optima, judged.refined, judged.assessment, judged.failure),
                            {}};
  if (!judged.failure && plan_.gathers_own() && assessor.decoys())
    registration.trail = Trail{judged.refined.T_us_ct,
                               *assessor.decoys(),
                               rivals_of(optima, in_.options.confidence.rival_mm, problem_.field),
                               {}};
  return registration;
}

std::optional<Registration> Attempt::at_once() {
  Assessor assessor = this->assessor();
  std::vector<Candidate> optima = searched(0, {});
  if (optima.empty()) return std::nullopt;
  const Assessment compared = this->compared(assessor, optima);
  run_.report(0.6);
  if (!assessor.parts_could_save(compared)) return std::nullopt;
  const Outcome<Judged> best = refine_and_judge(assessor, optima, compared, 1);
  if (!best || !is_believed(*best)) return std::nullopt;
  return ended(assessor, optima, *best);
}

std::optional<Registration> Attempt::in_one_round() {
  Assessor assessor = this->assessor();
  std::vector<Candidate> optima = searched(0, {});
  if (optima.empty() || !optima.front().has_value()) return std::nullopt;
  const Outcome<Candidate> refined = refine(images_, in_.ct, optima.front(), in_.options, run_);
  if (!refined || !run_.timed("confidence", [&] { return assessor.blocks_agree(*refined, run_); }))
    return std::nullopt;
  const Assessment compared = this->compared(assessor, optima);
  Outcome<Judged> best = judge_where_it_led(assessor, optima, compared, *refined);
  if (!best) return std::nullopt;
  follow_blocks(assessor, optima, *best, 1);
  Registration registration = ended(assessor, optima, *best);
  registration.by_blocks = true;
  registration.trail.reset();  // tracking climbs by the similarity of the other search
  return registration;
}

std::optional<Registration> Attempt::by_blocks() const {
  if (!plan_.gathers_own()) return std::nullopt;
  const std::unique_ptr<const BlockSearch> search = block_search(in_, images_);
  if (!search) return std::nullopt;
  return Attempt(in_, images_, search->problem(), run_).in_one_round();
}

Outcome<Registration> Attempt::search() {
  const int rounds = in_.options.search.rounds;
  Assessor assessor = this->assessor();
  std::vector<Candidate> optima;
  std::vector<Eigen::Isometry3d> refused;
  std::optional<Registration> matched;
  for (int round = 0;; ++round) {
    if (round == 1) matched = by_blocks();
    if (matched && is_registered(*matched)) return *std::move(matched);
    optima = searched(round, std::move(optima));
    if (optima.empty())
      return Refusal{RegistrationStatus::kNoOverlap,
                     "no pose in reach has CT and ultrasound overlap"};
    run_.report(0.2 + 0.8 * (round + 0.5) / rounds);
    const bool is_last = round + 1 == rounds;
    const Eigen::Isometry3d T_best = optima.front().T_us_ct;
    const bool was_refused = contains(refused, T_best);
    // Judged again, it would be refused again.
    if (!is_last && was_refused) continue;
    const Assessment compared = this->compared(assessor, optima);
    if (!is_last && !assessor.parts_could_save(compared)) continue;
    Outcome<Judged> best = refine_and_judge(assessor, optima, compared, round + 1);
    if (!best) return best.refusal();
    if (!was_refused) follow_blocks(assessor, optima, *best, round + 1);
    refused.insert(refused.end(), {T_best, optima.front().T_us_ct});
    run_.report(0.2 + 0.8 * (round + 1) / rounds);
    if (!best->failure) return ended(assessor, optima, *best);
    if (is_last || !may_be_missed(best->assessment.measures)) {
      // The climbs have missed a nearly symmetric kidney that they found in mirrored ultrasound.
      if (round == 0 && fits_mirrored(best->assessment.measures)) matched = by_blocks();
      return likelier(ended(assessor, optima, *best), std::move(matched));
    }
  }
}

std::optional<Registration> Attempt::tracked(const Lead& lead) {
  if (problem_.field.are_apart(problem_.T_us_ct_initial, lead.trail.T_us_ct, lead.reach_mm))
    return std::nullopt;
  const std::optional<Followed> followed = run_.timed("tracking", [&] {
    return follow(lead.trail, problem_, images_.prepared.us->beams, in_.options.confidence, run_);
  });
  if (!followed) return std::nullopt;
  const std::vector<Candidate>& optima = followed->optima;
  Assessor assessor = this->assessor();
  assessor.take_over(followed->decoys);
  const Assessment compared = this->compared(assessor, optima);
  const Outcome<Candidate> refined = refine(images_, in_.ct, optima.front(), in_.options, run_);
  if (!refined || has_left(optima.front(), *refined)) return std::nullopt;
  const Outcome<Judged> best = judge_refined(assessor, optima, compared, *refined);
  if (!best || !is_believed(*best)) return std::nullopt;
  Registration registration{result_of(optima, best->refined, best->assessment, best->failure), {}};
  registration.was_tracked = true;
  return registration;
}

}  // namespace usct::registration
