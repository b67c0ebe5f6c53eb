#include "registration/search/candidates.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "parallel.h"
#include "us_ct_registration/registration/pose_parameters.h"

namespace usct::registration {
namespace {

using Eigen::Isometry3d;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void set_value(Candidate& candidate, const SimilarityValue& value) {
  candidate.value =
      std::isfinite(value.value) ? value.value : -std::numeric_limits<double>::infinity();
  candidate.overlap = value.overlap;
}

/// The errors in the order of SimilarityDerivatives.
constexpr double AcquisitionErrors::*kErrors[] = {
    &AcquisitionErrors::depth, &AcquisitionErrors::sweep, &AcquisitionErrors::unevenness};

/// The parameters of an optimizer: six of the pose, then the errors that are estimated.
class Parameters {
 public:
  /// `scaled`: parameters about any pose.
  Parameters(const Climb& how, const Candidate& from, const PoseParameters& scaled)
      : how_(how), pose_(scaled.about(from.T_us_ct)), from_(from) {
    for (int i = 0; i < static_cast<int>(std::size(kErrors)); ++i)
      if (how.error_limits.*kErrors[i] > 0.0) free_.push_back(i);
  }

  OptimizerProblem problem() const {
    const int count = kMotion + static_cast<int>(free_.size());
    OptimizerProblem problem;
    problem.start = VectorXd::Zero(count);
    problem.lower = VectorXd::Constant(count, -how_.reach_mm);
    problem.upper = VectorXd::Constant(count, how_.reach_mm);
    problem.scale = VectorXd::Ones(count);
    int at = kMotion;
    for (const int error : free_) {
      const double limit = how_.error_limits.*kErrors[error];
      problem.scale[at] = kErrorPerUnit;
      problem.start[at] = from_.errors.*kErrors[error];
      problem.lower[at] = -limit;
      problem.upper[at] = limit;
      ++at;
    }
    return problem;
  }

  Candidate candidate(const VectorXd& x) const {
    Candidate result{pose_.T_us_ct(x.head<kMotion>()), from_.errors};
    int at = kMotion;
    for (const int error : free_) result.errors.*kErrors[error] = x[at++];
    return result;
  }

  /// The cost, which is minus the similarity, with its derivatives by the pose.
  CostModel model(const VectorXd& x, const SimilarityDerivatives& similarity) const {
    if (similarity.only_value) return {-similarity.value.value, {}, {}};
    const MatrixXd changes = by_parameters(x);
    return {-similarity.value.value, -changes.transpose() * similarity.gradient,
            changes.transpose() * similarity.curvature * changes};
  }

 private:
  static constexpr int kMotion = SimilarityDerivatives::kMotion;

  /// How the parameters change what SimilarityDerivatives are by. If the CT moves in the US frame,
  /// the ultrasound moves the other way in the CT.
  MatrixXd by_parameters(const VectorXd& x) const {
    MatrixXd changes = MatrixXd::Zero(SimilarityDerivatives::kCount, x.size());
    changes.topLeftCorner<kMotion, kMotion>() = -pose_.motion_derivative(x.head<kMotion>());
    int at = kMotion;
    for (const int error : free_) changes(kMotion + error, at++) = 1.0;
    return changes;
  }

  const Climb& how_;
  PoseParameters pose_;
  Candidate from_;
  std::vector<int> free_;  // of kErrors, those that are estimated
};

/// The optimizer for a climb on a similarity.
OptimizerOptions optimizer_of(const Climb& how, const Similarity& similarity) {
  OptimizerOptions optimizer = how.optimizer;
  optimizer.seed = how.seed;
  if (optimizer.method == OptimizerMethod::kGaussNewton && how.error_limits.any() &&
      !similarity.has_error_derivatives())
    optimizer.method = OptimizerMethod::kBobyqa;
  return optimizer;
}

void climb(const Similarity& similarity, const Climb& how, const PoseParameters& scaled,
           Candidate& candidate, Run& run) {
  const OptimizerOptions optimizer = optimizer_of(how, similarity);
  // Gauss-Newton begins with the value of its start, and ends there if it has none. Others go on.
  if (!candidate.has_value() && optimizer.method != OptimizerMethod::kGaussNewton) {
    set_value(candidate, similarity.evaluate(candidate.pose()));
    run.count_evaluations(1);
    if (!candidate.has_value()) return;
  }
  const Parameters parameters(how, candidate, scaled);
  OptimizerProblem problem = parameters.problem();
  SimilarityValue best;  // of the first of the best poses, as the optimizer's result
  const auto cost_of = [&](const SimilarityValue& value) {
    if (std::isfinite(value.value) && !(value.value <= best.value)) best = value;
    return -value.value;
  };
  problem.cost = [&](const VectorXd& x) {
    run.check_cancelled();
    return cost_of(similarity.evaluate(parameters.candidate(x).pose()));
  };
  problem.costs = [&](const std::vector<VectorXd>& points) {
    std::vector<SimilarityPose> poses;
    for (const VectorXd& x : points) poses.push_back(parameters.candidate(x).pose());
    std::vector<double> costs;
    for (const SimilarityValue& value : similarity.evaluate(poses, run.check()))
      costs.push_back(cost_of(value));
    return costs;
  };
  if (optimizer.method == OptimizerMethod::kGaussNewton)
    problem.model = [&](const VectorXd& x, bool with_curvature, double below) {
      run.check_cancelled();
      const auto order = with_curvature ? DerivativeOrder::kCurvature : DerivativeOrder::kGradient;
      const SimilarityDerivatives derivatives =
          similarity.derivatives(parameters.candidate(x).pose(), order, -below).value();
      cost_of(derivatives.value);
      return parameters.model(x, derivatives);
    };
  const OptimizerResult result = optimize(problem, optimizer);
  run.count_evaluations(static_cast<std::size_t>(result.evaluations));
  if (!result.best) return set_value(candidate, {});
  candidate = parameters.candidate(*result.best);
  set_value(candidate, best);
}

}  // namespace

void evaluate(const Similarity& similarity, std::vector<Candidate>& candidates, Run& run) {
  std::vector<SimilarityPose> poses;
  poses.reserve(candidates.size());
  for (const Candidate& candidate : candidates) poses.push_back(candidate.pose());
  const std::vector<SimilarityValue> values = similarity.evaluate(poses, run.check());
  for (std::size_t i = 0; i < candidates.size(); ++i) set_value(candidates[i], values[i]);
  run.count_evaluations(candidates.size());
}

void climb(const std::vector<Climbers>& groups, const Climb& how, const FieldPoints& field,
           Run& run) {
  std::vector<std::pair<const Similarity*, Candidate*>> all;
  for (const Climbers& group : groups)
    for (Candidate& candidate : group.candidates) all.emplace_back(&group.similarity, &candidate);
  if (all.empty()) return;
  const PoseParameters scaled(all.front().second->T_us_ct, field.us_mm());
  parallel_for(static_cast<int>(all.size()), [&](int i) {
    const auto& [similarity, candidate] = all[static_cast<std::size_t>(i)];
    climb(*similarity, how, scaled, *candidate, run);
  });
}

void climb(const Similarity& similarity, const Climb& how, const FieldPoints& field,
           std::vector<Candidate>& candidates, Run& run) {
  climb({{similarity, candidates}}, how, field, run);
}

Candidate climbed(const Similarity& similarity, const Climb& how, const FieldPoints& field,
                  const Candidate& from, Run& run) {
  std::vector<Candidate> one{from};
  climb(similarity, how, field, one, run);
  return one.front();
}

void sort_best_first(std::vector<Candidate>& candidates, std::size_t most) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.value > b.value; });
  if (candidates.size() > most) candidates.resize(most);
}

std::vector<Candidate> best_distinct(std::vector<Candidate> candidates, double distinct_mm,
                                     std::size_t most, const FieldPoints& field) {
  sort_best_first(candidates, candidates.size());
  std::vector<Candidate> kept;
  for (const Candidate& candidate : candidates) {
    if (kept.size() == most) break;
    if (std::all_of(kept.begin(), kept.end(), [&](const Candidate& better) {
          return field.are_apart(candidate.T_us_ct, better.T_us_ct, distinct_mm);
        }))
      kept.push_back(candidate);
  }
  return kept;
}

std::vector<Candidate> rivals_of(const std::vector<Candidate>& optima, double rival_mm,
                                 const FieldPoints& field) {
  constexpr std::size_t kRivals = 3;
  std::vector<Candidate> rivals;
  for (const Candidate& other : optima) {
    if (rivals.size() == kRivals) break;
    if (field.are_apart(other.T_us_ct, optima.front().T_us_ct, rival_mm)) rivals.push_back(other);
  }
  return rivals;
}

}  // namespace usct::registration
