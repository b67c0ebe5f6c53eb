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

/// The candidates from which a level is climbed. A choice among them compares them first; those
/// that a level before has chosen are climbed from as they are.
std::vector<Candidate> chosen(const SearchProblem& problem, std::size_t at, int round,
                              std::vector<Candidate> candidates, Run& run) {
  const auto most = static_cast<std::size_t>(problem.options.levels[at].optimised);
  if (candidates.size() > most) {
    screen(problem, at, candidates, run);
    evaluate(*problem.similarities[at].all, candidates, run);
    sort_best_first(candidates, most);
  }
  const bool is_start = at == 0 && problem.T_us_ct_given.isApprox(problem.T_us_ct_initial, 0.0);
  if (round == 0 && !is_start) candidates.push_back({problem.T_us_ct_given, {}});
  return candidates;
}

/// Replaces the candidates of each problem by the best distinct optima of one level that are
/// reached from them.
void climb_level(const std::vector<SearchProblem>& problems, std::size_t at, int round,
                 std::vector<std::vector<Candidate>>& candidates, Run& run) {
  const LevelOptions& level = problems.front().options.levels[at];
  const FieldPoints& field = problems.front().field;
  std::vector<Climbers> climbers;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    candidates[i] = chosen(problems[i], at, round, std::move(candidates[i]), run);
    climbers.push_back({*problems[i].similarities[at].all, candidates[i]});
  }
  climb(climbers, {level.optimizer, level.reach_mm, {}, problems.front().seed}, field, run);
  for (std::vector<Candidate>& of_problem : candidates)
    of_problem = best_distinct(std::move(of_problem), problems.front().options.distinct_mm,
                               static_cast<std::size_t>(level.kept), field);
}

}  // namespace

std::vector<std::vector<Candidate>> multi_start(const std::vector<SearchProblem>& problems,
                                                int round,
                                                std::vector<std::vector<Candidate>> found,
                                                Run& run) {
  std::vector<std::vector<Candidate>> all;
  for (const SearchProblem& problem : problems) all.push_back(starts_of(problem, round));
  for (std::size_t level = 0; level <= deciding_level(problems.front()); ++level)
    climb_level(problems, level, round, all, run);
  for (std::size_t i = 0; i < problems.size(); ++i) {
    const SearchOptions& options = problems[i].options;
    all[i].insert(all[i].end(), found[i].begin(), found[i].end());
    all[i] = best_distinct(std::move(all[i]), options.distinct_mm,
                           static_cast<std::size_t>(options.most_optima), problems[i].field);
    if (!all[i].empty() && !all[i].front().has_value()) all[i].clear();
  }
  return all;
}

std::vector<Candidate> multi_start(const SearchProblem& problem, int round,
                                   std::vector<Candidate> found, Run& run) {
  return multi_start(std::vector<SearchProblem>{problem}, round,
                     std::vector<std::vector<Candidate>>{std::move(found)}, run)
      .front();
}

std::vector<Candidate> optima_near(const std::vector<SearchProblem>& problems,
                                   const Eigen::Isometry3d& T_us_ct, double reach_mm, Run& run) {
  const LevelOptions& deciding = problems.front().options.levels.back();
  std::vector<std::vector<Candidate>> starts(problems.size(), {{T_us_ct, {}}});
  std::vector<Climbers> climbers;
  for (std::size_t i = 0; i < problems.size(); ++i)
    climbers.push_back({*problems[i].similarities.back().all, starts[i]});
  climb(climbers, {deciding.optimizer, reach_mm, {}, problems.front().seed}, problems.front().field,
        run);
  std::vector<Candidate> optima;
  for (const std::vector<Candidate>& of_problem : starts) optima.push_back(of_problem.front());
  return optima;
}

Candidate optimum_near(const SearchProblem& problem, const Eigen::Isometry3d& T_us_ct,
                       double reach_mm, Run& run) {
  return optima_near(std::vector<SearchProblem>{problem}, T_us_ct, reach_mm, run).front();
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
