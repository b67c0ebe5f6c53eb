#include "optimizer/evaluator.h"

#include <algorithm>
#include <cmath>

namespace usct::optimizer {
namespace {

/// Maps all numbers onto [lower, upper], and 0 onto 0. The map is smooth, so that a minimum on a
/// face looks like any other minimum; reflection at the face would make it a kink. Without bounds
/// it is the identity.
double folded(double value, double lower, double upper) {
  if (std::isinf(lower)) return value;
  const double centre = 0.5 * (lower + upper);
  const double half_width = 0.5 * (upper - lower);
  const double phase_of_0 = std::asin(std::clamp(-centre / half_width, -1.0, 1.0));
  return centre + half_width * std::sin(phase_of_0 + value / half_width);
}

}  // namespace

Evaluator::Evaluator(const OptimizerProblem& problem, const OptimizerOptions& options,
                     const OptimizerHooks& hooks)
    : problem_(problem),
      options_(options),
      hooks_(hooks),
      lower_((problem.lower - problem.start).cwiseQuotient(problem.scale)),
      upper_((problem.upper - problem.start).cwiseQuotient(problem.scale)) {}

void Evaluator::evaluate_start() {
  start_cost_ = evaluate(Eigen::VectorXd::Zero(problem_.start.size()));
}

double Evaluator::at(const Eigen::VectorXd& units) {
  // The cost of the start is known; methods that begin there do not evaluate it again.
  if (units.isZero(0.0) && std::isfinite(start_cost_)) return start_cost_;
  if (!units.allFinite())
    throw Stop{OptimizerStatus::kConverged, "rounding allows no further step"};
  const double cost = evaluate(units);
  if (std::isfinite(cost)) return cost;
  return std::isfinite(worst_) ? worst_ : std::numeric_limits<double>::max();
}

double Evaluator::at_folded(const Eigen::VectorXd& units) {
  if (units.isZero(0.0)) return at(units);
  return at(in_box(units));
}

void Evaluator::look_ahead(const std::vector<Eigen::VectorXd>& units) {
  ahead_.clear();
  if (!problem_.costs) return;
  const auto left = static_cast<std::size_t>(options_.max_evaluations - so_far_.evaluations);
  std::vector<Eigen::VectorXd> points;
  for (std::size_t i = 0; i < std::min(left, units.size()); ++i)
    if (units[i].allFinite()) points.push_back(parameters_at(in_box(units[i])));
  if (points.empty() || (hooks_.cancelled && hooks_.cancelled())) return;
  const std::vector<double> costs = problem_.costs(points);
  for (std::size_t i = 0; i < points.size(); ++i) ahead_.emplace_back(points[i], costs.at(i));
}

Eigen::VectorXd Evaluator::in_box(const Eigen::VectorXd& units) const {
  Eigen::VectorXd result(units.size());
  for (Eigen::Index i = 0; i < units.size(); ++i)
    result[i] = folded(units[i], lower_[i], upper_[i]);
  return result;
}

CostModel Evaluator::model_at(const Eigen::VectorXd& units, bool with_curvature, double below) {
  const Eigen::VectorXd parameters = next(units);
  CostModel model = problem_.model(parameters, with_curvature, below);
  record(parameters, model.cost);
  if (!std::isfinite(model.cost)) return {};
  if (model.gradient.size() == 0) return model;
  model.gradient = model.gradient.cwiseProduct(problem_.scale).eval();
  if (with_curvature)
    model.curvature =
        (problem_.scale.asDiagonal() * model.curvature * problem_.scale.asDiagonal()).eval();
  return model;
}

double Evaluator::evaluate(const Eigen::VectorXd& units) {
  const Eigen::VectorXd parameters = next(units);
  const double cost = cost_of(parameters);
  record(parameters, cost);
  return std::isfinite(cost) ? cost : std::numeric_limits<double>::quiet_NaN();
}

double Evaluator::cost_of(const Eigen::VectorXd& parameters) {
  if (ahead_.empty() || ahead_.front().first != parameters) return problem_.cost(parameters);
  const double cost = ahead_.front().second;
  ahead_.pop_front();
  return cost;
}

Eigen::VectorXd Evaluator::parameters_at(const Eigen::VectorXd& units) const {
  // Rounding may have moved a point on a face out of the box.
  return (problem_.start + problem_.scale.cwiseProduct(units))
      .cwiseMax(problem_.lower)
      .cwiseMin(problem_.upper);
}

Eigen::VectorXd Evaluator::next(const Eigen::VectorXd& units) const {
  if (hooks_.cancelled && hooks_.cancelled())
    throw Stop{OptimizerStatus::kCancelled, "cancelled by the caller"};
  if (so_far_.evaluations >= options_.max_evaluations)
    throw Stop{OptimizerStatus::kBudgetExhausted,
               "all " + std::to_string(options_.max_evaluations) + " evaluations were made"};
  return parameters_at(units);
}

void Evaluator::record(const Eigen::VectorXd& parameters, double cost) {
  ++so_far_.evaluations;
  if (std::isfinite(cost)) {
    if (!so_far_.best || cost < so_far_.cost) {
      so_far_.best = parameters;
      so_far_.cost = cost;
    }
    if (!(cost <= worst_)) worst_ = cost;
  }
  if (hooks_.progress) hooks_.progress(so_far_.evaluations, so_far_.cost);
}

OptimizerResult Evaluator::result(const Stop& stop) const {
  OptimizerResult result = so_far_;
  result.status = stop.status;
  result.reason = stop.reason;
  if (!result.best && result.evaluations > 0 && stop.status != OptimizerStatus::kCancelled) {
    result.status = OptimizerStatus::kFailed;
    result.reason =
        "none of " + std::to_string(result.evaluations) + " costs was finite (" + stop.reason + ")";
  }
  return result;
}

}  // namespace usct::optimizer
