#include "registration/search/multi_start.h"

#include <algorithm>

#include "us_ct_registration/registration/pose_parameters.h"
#include "us_ct_registration/registration/starts.h"

namespace usct::registration {
namespace {

/// The starts of a round. The rounds take consecutive parts of one sequence. The first part begins
/// with the initial pose.
std::vector<Candidate> starts_of(const SearchProblem& problem, int round, Run& run) {
  if (!problem.options.starts) return {{problem.T_us_ct_initial, {}}};
  if (problem.blocks != nullptr)
    return problem.blocks->poses(
        problem.T_us_ct_initial, problem.mirror, problem.field, problem.options.distinct_mm,
        static_cast<std::size_t>(problem.options.levels.front().optimised), run);
  const StartOptions& starts = *problem.options.starts;
  const PoseParameters pose(problem.T_us_ct_initial, problem.field.us_mm());
  const std::size_t first =
      static_cast<std::size_t>(round) * static_cast<std::size_t>(starts.count);
  std::vector<Candidate> candidates;
  for (const PoseVector& start : spread_starts(pose, starts, first))
    candidates.push_back({pose.T_us_ct(start), {}});
  const std::vector<Eigen::Vector3d>& shifts = problem.start_shifts_us_mm;
  const std::size_t unmoved = shifts.empty() ? 0 : candidates.size();
  for (std::size_t i = 0; i < unmoved; ++i)
    candidates.push_back(
        {Eigen::Translation3d(shifts[i % shifts.size()]) * candidates[i].T_us_ct, {}});
  return candidates;
}

/// Candidates of several problems, an entry for each.
using Candidates = std::vector<std::vector<Candidate>>;

/// Problems whose candidates are chosen together, and how many searches they share.
struct Pool {
  std::size_t first;
  std::size_t end;  // after the last one
  std::size_t searches;
};

/// All problems together if they compete, else each by itself.
std::vector<Pool> pools_of(std::size_t problems, std::optional<int> competing_for) {
  if (competing_for) return {{0, problems, static_cast<std::size_t>(*competing_for)}};
  std::vector<Pool> pools;
  for (std::size_t i = 0; i < problems; ++i) pools.push_back({i, i + 1, 1});
  return pools;
}

/// Problems that differ in their similarities, given poses and shifts only.
class Climbing {
 public:
  Climbing(const std::vector<SearchProblem>& problems, int round, std::optional<int> competing_for,
           Run& run)
      : problems_(problems),
        round_(round),
        pools_(pools_of(problems.size(), competing_for)),
        run_(run) {}

  /// The distinct optima of the deciding level, best first, that the starts of the round lead to.
  Candidates optima();

 private:
  const LevelOptions& level(std::size_t at) const { return problems_.front().options.levels[at]; }
  const FieldPoints& field() const { return problems_.front().field; }

  std::size_t count(const Pool& pool) const;
  /// Fills in the values of a pool's candidates by all samples of a level, or by those that screen.
  void evaluate_all(const Pool& pool, std::size_t at, const Similarity* LevelSimilarities::*by);
  /// Sorts the candidates of each problem best first, and keeps the best of the pool.
  void keep_best(const Pool& pool, std::size_t most);
  /// Keeps the best candidates by a part of the samples, if a level screens and there are more.
  void screen(const Pool& pool, std::size_t at);
  /// Leaves the candidates from which a level is climbed. A choice among them compares them first;
  /// those that a level before has chosen are climbed from as they are.
  void choose(const Pool& pool, std::size_t at);
  void add_given(std::size_t at);
  /// Replaces the candidates by the best distinct optima of one level that are reached from them.
  void climb_level(std::size_t at);

  const std::vector<SearchProblem>& problems_;
  const int round_;
  const std::vector<Pool> pools_;
  Run& run_;
  Candidates candidates_;
};

std::size_t Climbing::count(const Pool& pool) const {
  std::size_t count = 0;
  for (std::size_t i = pool.first; i < pool.end; ++i) count += candidates_[i].size();
  return count;
}

void Climbing::evaluate_all(const Pool& pool, std::size_t at,
                            const Similarity* LevelSimilarities::*by) {
  for (std::size_t i = pool.first; i < pool.end; ++i)
    evaluate(*(problems_[i].similarities[at].*by), candidates_[i], run_);
}

void Climbing::keep_best(const Pool& pool, std::size_t most) {
  struct Entry {
    std::size_t problem;
    Candidate candidate;
  };
  std::vector<Entry> all;
  for (std::size_t i = pool.first; i < pool.end; ++i) {
    for (const Candidate& candidate : candidates_[i]) all.push_back({i, candidate});
    candidates_[i].clear();
  }
  std::stable_sort(all.begin(), all.end(), [](const Entry& a, const Entry& b) {
    return a.candidate.value > b.candidate.value;
  });
  all.resize(std::min(all.size(), most));
  for (const Entry& entry : all) candidates_[entry.problem].push_back(entry.candidate);
}

void Climbing::screen(const Pool& pool, std::size_t at) {
  const std::optional<int>& screened = level(at).screened;
  if (!screened || problems_.front().similarities[at].screening == nullptr) return;
  const std::size_t most = pool.searches * static_cast<std::size_t>(*screened);
  if (count(pool) <= most) return;
  evaluate_all(pool, at, &LevelSimilarities::screening);
  keep_best(pool, most);
}

void Climbing::choose(const Pool& pool, std::size_t at) {
  const std::size_t most = pool.searches * static_cast<std::size_t>(level(at).optimised);
  if (count(pool) <= most) return;
  screen(pool, at);
  evaluate_all(pool, at, &LevelSimilarities::all);
  keep_best(pool, most);
}

void Climbing::add_given(std::size_t at) {
  for (std::size_t i = 0; i < problems_.size(); ++i) {
    const Eigen::Isometry3d& given = problems_[i].T_us_ct_given;
    const bool is_start = at == 0 && given.isApprox(problems_[i].T_us_ct_initial, 0.0);
    if (!is_start) candidates_[i].push_back({given, {}});
  }
}

void Climbing::climb_level(std::size_t at) {
  for (const Pool& pool : pools_) choose(pool, at);
  if (round_ == 0) add_given(at);
  std::vector<Climbers> climbers;
  for (std::size_t i = 0; i < problems_.size(); ++i)
    climbers.push_back({*problems_[i].similarities[at].all, candidates_[i]});
  // The threads share the climbs of all problems.
  climb(climbers, {level(at).optimizer, level(at).reach_mm, {}, problems_.front().seed}, field(),
        run_);
  for (const Pool& pool : pools_) {
    const std::size_t kept = pool.searches * static_cast<std::size_t>(level(at).kept);
    for (std::size_t i = pool.first; i < pool.end; ++i)
      candidates_[i] = best_distinct(std::move(candidates_[i]),
                                     problems_.front().options.distinct_mm, kept, field());
    keep_best(pool, kept);
  }
}

Candidates Climbing::optima() {
  candidates_.clear();
  for (const SearchProblem& problem : problems_)
    candidates_.push_back(starts_of(problem, round_, run_));
  for (std::size_t at = 0; at < problems_.front().options.levels.size(); ++at) climb_level(at);
  return candidates_;
}

}  // namespace

std::vector<std::vector<Candidate>> multi_start(const std::vector<SearchProblem>& problems,
                                                int round,
                                                std::vector<std::vector<Candidate>> found, Run& run,
                                                std::optional<int> competing_for) {
  Candidates all = Climbing(problems, round, competing_for, run).optima();
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
  // A reach of less is none to the optimizer.
  const double least_mm = 2.0 * deciding.optimizer.step_tolerance;
  std::vector<std::vector<Candidate>> starts(problems.size(), {{T_us_ct, {}}});
  std::vector<Climbers> climbers;
  for (std::size_t i = 0; i < problems.size(); ++i)
    climbers.push_back({*problems[i].similarities.back().all, starts[i]});
  climb(climbers, {deciding.optimizer, std::max(reach_mm, least_mm), {}, problems.front().seed},
        problems.front().field, run);
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
