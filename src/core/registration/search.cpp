#include "registration/search.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "parallel.h"

namespace usct::registration {
namespace {

using Eigen::Isometry3d;
using Eigen::VectorXd;

/// Candidates per share of work: an evaluation at a coarse stage takes microseconds.
constexpr int kShare = 16;

void set_value(Candidate& candidate, const SimilarityValue& value) {
  candidate.value =
      std::isfinite(value.value) ? value.value : -std::numeric_limits<double>::infinity();
  candidate.overlap = value.overlap;
}

/// The parameters that a stage optimises: six of the pose, then the errors that it estimates.
class StageParameters {
 public:
  StageParameters(const StageOptions& stage, const Candidate& from,
                  const std::vector<Eigen::Vector3d>& points_us_mm)
      : pose_(from.T_us_ct, points_us_mm), from_(from), stage_(stage) {}

  OptimizerProblem problem() const {
    const int count = 6 + (stage_.depth_error > 0.0 ? 1 : 0) + (stage_.sweep_error > 0.0 ? 1 : 0);
    OptimizerProblem problem;
    problem.start = VectorXd::Zero(count);
    problem.lower = VectorXd::Constant(count, -stage_.reach_mm);
    problem.upper = VectorXd::Constant(count, stage_.reach_mm);
    problem.scale = VectorXd::Ones(count);
    int at = 6;
    for (const double limit : {stage_.depth_error, stage_.sweep_error}) {
      if (!(limit > 0.0)) continue;
      // One percent moves the far end of a usual field of view by about a millimetre.
      constexpr double kScale = 0.01;
      problem.scale[at] = kScale;
      problem.lower[at] = -limit;
      problem.upper[at] = limit;
      ++at;
    }
    return problem;
  }

  Candidate candidate(const VectorXd& x) const {
    Candidate result{pose_.T_us_ct(x.head<6>()), from_.errors};
    int at = 6;
    if (stage_.depth_error > 0.0) result.errors.depth = x[at++];
    if (stage_.sweep_error > 0.0) result.errors.sweep = x[at++];
    return result;
  }

 private:
  PoseParameters pose_;
  Candidate from_;
  const StageOptions& stage_;
};

}  // namespace

void Search::check_cancelled() const {
  if (!hooks_.cancelled) return;
  const std::lock_guard<std::mutex> one_at_a_time(asking_);
  if (hooks_.cancelled()) throw Cancelled{};
}

double Search::distance_mm(const Isometry3d& T_a_us_ct, const Isometry3d& T_b_us_ct) const {
  return mean_displacement_mm(T_a_us_ct * T_b_us_ct.inverse(), Isometry3d::Identity(),
                              points_us_mm_);
}

void Search::sort(std::vector<Candidate>& candidates, std::size_t most) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.value > b.value; });
  if (candidates.size() > most) candidates.resize(most);
}

std::vector<Candidate> Search::best_distinct(std::vector<Candidate> candidates,
                                             std::size_t most) const {
  sort(candidates, candidates.size());
  std::vector<Candidate> kept;
  for (const Candidate& candidate : candidates) {
    if (kept.size() == most) break;
    if (std::all_of(kept.begin(), kept.end(), [&](const Candidate& better) {
          return distance_mm(candidate.T_us_ct, better.T_us_ct) > options_.distinct_mm;
        }))
      kept.push_back(candidate);
  }
  return kept;
}

void Search::evaluate(const Similarity& similarity, std::vector<Candidate>& candidates) {
  const int count = static_cast<int>(candidates.size());
  parallel_for((count + kShare - 1) / kShare, [&](int share) {
    for (int i = share * kShare; i < std::min(count, (share + 1) * kShare); ++i) {
      check_cancelled();
      Candidate& candidate = candidates[static_cast<std::size_t>(i)];
      set_value(candidate, similarity.evaluate(candidate.T_us_ct.inverse(), candidate.errors));
    }
  });
  evaluations_ += count;
}

void Search::optimise(const Similarity& similarity, const StageOptions& stage,
                      std::vector<Candidate>& candidates) {
  if (candidates.size() == 1) {  // the threads are the similarity's
    evaluations_ += optimise(similarity, stage, candidates.front());
    return;
  }
  std::vector<int> evaluations(candidates.size());
  parallel_for(static_cast<int>(candidates.size()), [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    evaluations[at] = optimise(similarity, stage, candidates[at]);
  });
  evaluations_ = std::accumulate(evaluations.begin(), evaluations.end(), evaluations_);
}

int Search::optimise(const Similarity& similarity, const StageOptions& stage,
                     Candidate& candidate) const {
  if (!std::isfinite(candidate.value)) return 0;  // nothing to climb
  const StageParameters parameters(stage, candidate, points_us_mm_);
  OptimizerProblem problem = parameters.problem();
  problem.cost = [&](const VectorXd& x) {
    check_cancelled();
    const Candidate at = parameters.candidate(x);
    return -similarity.evaluate(at.T_us_ct.inverse(), at.errors).value;
  };
  OptimizerOptions how = stage.optimizer;
  how.seed = options_.seed;
  const OptimizerResult result = optimize(problem, how);
  if (result.best) {
    candidate = parameters.candidate(*result.best);
    set_value(candidate, similarity.evaluate(candidate.T_us_ct.inverse(), candidate.errors));
  }
  return result.evaluations;
}

}  // namespace usct::registration
