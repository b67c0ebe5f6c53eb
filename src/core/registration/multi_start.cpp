#include "registration/multi_start.h"

#include <algorithm>

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
  const std::vector<Eigen::Vector3d>& shifts = problem.start_shifts_us_mm;
  const std::size_t unmoved = shifts.empty() ? 0 : candidates.size();
  for (std::size_t i = 0; i < unmoved; ++i)
    candidates.push_back(
        {Eigen::Translation3d(shifts[i % shifts.size()]) * candidates[i].T_us_ct, {}});
  return candidates;
}

/// Candidates of several problems, an entry for each.
using Candidates = std::vector<std::vector<Candidate>>;

std::size_t count_of(const Candidates& candidates) {
  std::size_t count = 0;
  for (const std::vector<Candidate>& of_problem : candidates) count += of_problem.size();
  return count;
}

/// Sorts the candidates of each problem best first, and keeps the best of all, `most` together.
void keep_best(Candidates& candidates, std::size_t most) {
  struct Entry {
    std::size_t problem;
    Candidate candidate;
  };
  std::vector<Entry> all;
  for (std::size_t i = 0; i < candidates.size(); ++i)
    for (const Candidate& candidate : candidates[i]) all.push_back({i, candidate});
  std::stable_sort(all.begin(), all.end(), [](const Entry& a, const Entry& b) {
    return a.candidate.value > b.candidate.value;
  });
  all.resize(std::min(all.size(), most));
  for (std::vector<Candidate>& of_problem : candidates) of_problem.clear();
  for (const Entry& entry : all) candidates[entry.problem].push_back(entry.candidate);
}

/// Keeps the best candidates by a part of the samples, if a level screens and there are more.
void screen(const std::vector<SearchProblem>& problems, std::size_t at, std::size_t searches,
            Candidates& candidates, Run& run) {
  const std::optional<int>& screened = problems.front().options.levels[at].screened;
  if (!screened || problems.front().similarities[at].screening == nullptr) return;
  const std::size_t most = searches * static_cast<std::size_t>(*screened);
  if (count_of(candidates) <= most) return;
  for (std::size_t i = 0; i < problems.size(); ++i)
    evaluate(*problems[i].similarities[at].screening, candidates[i], run);
  keep_best(candidates, most);
}

/// Leaves the candidates from which a level is climbed, as many as so many searches take. A choice
/// among them compares them first; those that a level before has chosen are climbed from as they
/// are.
void choose(const std::vector<SearchProblem>& problems, std::size_t at, int round,
            std::size_t searches, Candidates& candidates, Run& run) {
  const std::size_t most =
      searches * static_cast<std::size_t>(problems.front().options.levels[at].optimised);
  if (count_of(candidates) > most) {
    screen(problems, at, searches, candidates, run);
    for (std::size_t i = 0; i < problems.size(); ++i)
      evaluate(*problems[i].similarities[at].all, candidates[i], run);
    keep_best(candidates, most);
  }
  if (round > 0) return;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    const Eigen::Isometry3d& given = problems[i].T_us_ct_given;
    const bool is_start = at == 0 && given.isApprox(problems[i].T_us_ct_initial, 0.0);
    if (!is_start) candidates[i].push_back({given, {}});
  }
}

/// Replaces the candidates of each problem by the best distinct optima of one level that are
/// reached from them.
void climb_level(const std::vector<SearchProblem>& problems, std::size_t at, int round,
                 std::optional<int> competing_for, Candidates& candidates, Run& run) {
  const LevelOptions& level = problems.front().options.levels[at];
  const FieldPoints& field = problems.front().field;
  const auto searches = static_cast<std::size_t>(competing_for.value_or(1));
  if (competing_for) choose(problems, at, round, searches, candidates, run);
  std::vector<Climbers> climbers;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    if (!competing_for) {
      Candidates own{std::move(candidates[i])};
      choose({problems[i]}, at, round, searches, own, run);
      candidates[i] = std::move(own.front());
    }
    climbers.push_back({*problems[i].similarities[at].all, candidates[i]});
  }
  climb(climbers, {level.optimizer, level.reach_mm, {}, problems.front().seed}, field, run);
  const std::size_t kept = searches * static_cast<std::size_t>(level.kept);
  for (std::vector<Candidate>& of_problem : candidates)
    of_problem =
        best_distinct(std::move(of_problem), problems.front().options.distinct_mm, kept, field);
  if (competing_for) keep_best(candidates, kept);
}

}  // namespace

std::vector<std::vector<Candidate>> multi_start(const std::vector<SearchProblem>& problems,
                                                int round,
                                                std::vector<std::vector<Candidate>> found, Run& run,
                                                std::optional<int> competing_for) {
  Candidates all;
  for (const SearchProblem& problem : problems) all.push_back(starts_of(problem, round));
  for (std::size_t level = 0; level <= deciding_level(problems.front()); ++level)
    climb_level(problems, level, round, competing_for, all, run);
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
    if (problem.field.are_apart(other.T_us_ct, first.T_us_ct, problem.options.distinct_mm))
      optima.push_back(other);
  return optima;
}

}  // namespace usct::registration
