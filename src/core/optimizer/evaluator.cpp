#include "optimizer/evaluator.h"

#include <algorithm>
#include <cmath>

namespace usct::optimizer {
namespace {

/// Space folded at the faces of [lower, upper], which may be infinite: continuous, and the identity
/// within.
double mirrored(double value, double lower, double upper) {
  if (value >= lower && value <= upper) return value;
  if (std::isinf(upper)) return 2.0 * lower - value;
  if (std::isinf(lower)) return 2.0 * upper - value;
  const double width = upper - lower;
  const double beyond = std::fmod(std::abs(value - lower), 2.0 * width);
  return lower + (beyond <= width ? beyond : 2.0 * width - beyond);
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
  // Methods that begin at the start need not pay for it again.
  if (units.isZero(0.0) && std::isfinite(start_cost_)) return start_cost_;
  if (!units.allFinite())
    throw Stop{OptimizerStatus::kConverged, "rounding allows no further step"};
  const double cost = evaluate(units);
  if (std::isfinite(cost)) return cost;
  return std::isfinite(worst_) ? worst_ : std::numeric_limits<double>::max();
}

double Evaluator::at_mirror_image(Eigen::VectorXd units) {
  for (Eigen::Index i = 0; i < units.size(); ++i)
    units[i] = mirrored(units[i], lower_[i], upper_[i]);
  return at(units);
}

double Evaluator::evaluate(const Eigen::VectorXd& units) {
  if (hooks_.cancelled && hooks_.cancelled())
    throw Stop{OptimizerStatus::kCancelled, "cancelled by the caller"};
  if (so_far_.evaluations >= options_.max_evaluations)
    throw Stop{OptimizerStatus::kBudgetExhausted,
               "all " + std::to_string(options_.max_evaluations) + " evaluations were made"};
  // Rounding may have carried a point on a face out of the box.
  const Eigen::VectorXd parameters = (problem_.start + problem_.scale.cwiseProduct(units))
                                         .cwiseMax(problem_.lower)
                                         .cwiseMin(problem_.upper);
  const double cost = problem_.cost(parameters);
  ++so_far_.evaluations;
  if (std::isfinite(cost)) {
    if (!so_far_.best || cost < so_far_.cost) {
      so_far_.best = parameters;
      so_far_.cost = cost;
    }
    if (!(cost <= worst_)) worst_ = cost;
  }
  if (hooks_.progress) hooks_.progress(so_far_.evaluations, so_far_.cost);
  return std::isfinite(cost) ? cost : std::numeric_limits<double>::quiet_NaN();
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
