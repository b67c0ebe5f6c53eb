#include "registration/multi_start.h"

#include "us_ct_registration/registration/pose_parameters.h"
#include "us_ct_registration/registration/starts.h"

namespace usct::registration {
namespace {

std::size_t deciding_level(const SearchProblem& problem) {
  return problem.options.levels.size() - 1;
}

/// The starts of a round. The rounds take consecutive parts of one sequence. The first part begins
/// with the initial pose.
std::vector<Candidate> starts_of(const SearchProblem& problem, int round) {
  if (!problem.options.starts) return {{problem.T_us_ct_initial, {}}};
  StartOptions all = *problem.options.starts;
  const int first = round * all.count;
  all.count += first;
  const PoseParameters pose(problem.T_us_ct_initial, problem.field.us_mm());
  const std::vector<PoseVector> vectors = spread_starts(pose, all);
  std::vector<Candidate> candidates;
  for (auto i = static_cast<std::size_t>(first); i < vectors.size(); ++i)
    candidates.push_back({pose.T_us_ct(vectors[i]), {}});
  return candidates;
}

/// Keeps the best candidates by a part of the samples, if a level screens and there are more.
void screen(const SearchProblem& problem, std::size_t at, std::vector<Candidate>& candidates,
            Run& run) {
  const std::optional<int>& screened = problem.options.levels[at].screened;
  const Similarity* similarity = problem.similarities[at].screening;
  if (!screened || similarity == nullptr) return;
  const auto most = static_cast<std::size_t>(*screened);
  if (candidates.size() <= most) return;
  evaluate(*similarity, candidates, run);
  sort_best_first(candidates, most);
}

/// The best distinct optima of one level that are reached from the candidates. A choice among them
/// compares them first; those that a level before has chosen are climbed from as they are.
std::vector<Candidate> climb_level(const SearchProblem& problem, std::size_t at, int round,
                                   std::vector<Candidate> candidates, Run& run) {
  const LevelOptions& level = problem.options.levels[at];
  const Similarity& similarity = *problem.similarities[at].all;
  const auto most = static_cast<std::size_t>(level.optimised);
  if (candidates.size() > most || !candidates.front().has_value()) {
    screen(problem, at, candidates, run);
    evaluate(similarity, candidates, run);
    sort_best_first(candidates, most);
  }
  const bool is_start = at == 0 && problem.T_us_ct_given.isApprox(problem.T_us_ct_initial, 0.0);
  if (round == 0 && !is_start) {
    std::vector<Candidate> given{{problem.T_us_ct_given, {}}};
    evaluate(similarity, given, run);
    candidates.push_back(given.front());
  }
  climb(similarity, {level.optimizer, level.reach_mm, {}, problem.seed}, problem.field, candidates,
        run);
  return best_distinct(std::move(candidates), problem.options.distinct_mm,
                       static_cast<std::size_t>(level.kept), problem.field);
}

}  // namespace

std::vector<Candidate> multi_start(const SearchProblem& problem, int round,
                                   std::vector<Candidate> found, Run& run) {
  const SearchOptions& options = problem.options;
  std::vector<Candidate> candidates = starts_of(problem, round);
  for (std::size_t level = 0; level <= deciding_level(problem); ++level)
    candidates = climb_level(problem, level, round, std::move(candidates), run);
  candidates.insert(candidates.end(), found.begin(), found.end());
  candidates = best_distinct(std::move(candidates), options.distinct_mm,
                             static_cast<std::size_t>(options.most_optima), problem.field);
  if (!candidates.empty() && !candidates.front().has_value()) candidates.clear();
  return candidates;
}

Candidate optimum_near(const SearchProblem& problem, const Eigen::Isometry3d& T_us_ct,
                       double reach_mm, Run& run) {
  const LevelOptions& deciding = problem.options.levels.back();
  const Similarity& similarity = *problem.similarities.back().all;
  std::vector<Candidate> optimum{{T_us_ct, {}}};
  evaluate(similarity, optimum, run);
  climb(similarity, {deciding.optimizer, reach_mm, {}, problem.seed}, problem.field, optimum, run);
  return optimum.front();
}

std::vector<Candidate> headed_by(const Candidate& first, const std::vector<Candidate>& others,
                                 const SearchProblem& problem) {
  std::vector<Candidate> optima{first};
  for (const Candidate& other : others)
    if (problem.field.distance_mm(other.T_us_ct, first.T_us_ct) > problem.options.distinct_mm)
      optima.push_back(other);
  return optima;
}

}  // namespace usct::registration
