#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "optimizer/evaluator.h"

namespace usct::optimizer {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The step of at most `radius` that minimises g.s + s.H s / 2, for H positive semidefinite: that
/// of Levenberg and Marquardt, with the least damping that keeps it within the radius.
VectorXd damped_step(const VectorXd& gradient, const MatrixXd& curvature, double radius) {
  const double slope = gradient.norm();
  if (slope == 0.0) return VectorXd::Zero(gradient.size());
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(curvature);
  const VectorXd along = axes.eigenvectors().transpose() * gradient;
  const VectorXd eigenvalues = axes.eigenvalues().cwiseMax(0.0);
  const auto with = [&](double damping) -> VectorXd {
    return -along.cwiseQuotient((eigenvalues.array() + damping).matrix());
  };
  constexpr double kLeastDamping = 1e-9;
  double high = slope / radius;  // damped so much, no step is longer
  double low = std::min(high, kLeastDamping * std::max(high, eigenvalues.maxCoeff()));
  if (with(low).norm() <= radius) return axes.eigenvectors() * with(low);
  constexpr int kBisections = 50;
  for (int i = 0; i < kBisections; ++i) {
    const double middle = std::sqrt(low * high);
    (with(middle).norm() > radius ? low : high) = middle;
  }
  return axes.eigenvectors() * with(high);
}

/// Calls damped_step for the parameters that a face of the box does not hold, and ends the step
/// where it leaves the box.
VectorXd step_in_box(const VectorXd& gradient, const MatrixXd& curvature, const VectorXd& at,
                     const Evaluator& evaluator, double radius) {
  std::vector<Index> free;
  for (Index i = 0; i < at.size(); ++i) {
    const bool held = (at[i] <= evaluator.lower()[i] && gradient[i] > 0.0) ||
                      (at[i] >= evaluator.upper()[i] && gradient[i] < 0.0);
    if (!held) free.push_back(i);
  }
  const auto size = static_cast<Index>(free.size());
  MatrixXd chosen = MatrixXd::Zero(at.size(), size);
  for (Index i = 0; i < size; ++i) chosen(free[static_cast<std::size_t>(i)], i) = 1.0;
  VectorXd to = at;
  if (size > 0)
    to += chosen * damped_step(chosen.transpose() * gradient,
                               chosen.transpose() * curvature * chosen, radius);
  return to.cwiseMax(evaluator.lower()).cwiseMin(evaluator.upper()) - at;
}

/// Corrects a curvature so that it explains by how much the gradient changed over a step: the
/// update of Broyden, Fletcher, Goldfarb and Shanno, damped as Powell (1978) does it, so that the
/// curvature stays positive. The first time the whole curvature is scaled (Oren and Luenberger
/// 1974): noise in the images makes that of Gauss and Newton too large in all directions alike.
class CurvatureUpdate {
 public:
  void operator()(MatrixXd& curvature, const VectorXd& step, VectorXd change) {
    const double measured = step.dot(change);
    double assumed = step.dot(curvature * step);
    if (!(assumed > 0.0)) return;
    if (!scaled_ && measured > 0.0) {
      constexpr double kLeastScale = 0.01;
      const double scale = std::clamp(measured / assumed, kLeastScale, 1.0);
      curvature *= scale;
      assumed *= scale;
      scaled_ = true;
    }
    const VectorXd along = curvature * step;
    constexpr double kLeast = 0.2;  // share of the assumed curvature that is left along the step
    if (measured < kLeast * assumed) {
      const double believed = (1.0 - kLeast) * assumed / (assumed - measured);
      change = believed * change + (1.0 - believed) * along;
    }
    curvature +=
        change * change.transpose() / step.dot(change) - along * along.transpose() / assumed;
  }

 private:
  bool scaled_ = false;
};

/// The share of an uphill step after which the parabola through both costs and the slope has its
/// minimum, within limits.
double downhill_share(const CostModel& here, const VectorXd& step, double cost_there) {
  if (!std::isfinite(cost_there)) return 0.25;
  const double slope = here.gradient.dot(step);
  return std::clamp(0.5 * slope / (here.cost + slope - cost_there), 0.1, 0.5);
}

}  // namespace

Stop run_gauss_newton(Evaluator& evaluator, const OptimizerOptions& options) {
  VectorXd at = VectorXd::Zero(evaluator.lower().size());
  CostModel here = evaluator.model_at(at, true, std::numeric_limits<double>::infinity());
  if (!std::isfinite(here.cost))
    throw Stop{OptimizerStatus::kFailed,
               "the cost is not finite at the start, which gauss_newton needs"};
  MatrixXd curvature = here.curvature;
  CurvatureUpdate update;
  double radius = options.initial_step;
  while (true) {
    const VectorXd step = step_in_box(here.gradient, curvature, at, evaluator, radius);
    const double length = step.norm();
    if (length < options.step_tolerance) {
      if (length > 0.0) evaluator.at(at + step);
      return {OptimizerStatus::kConverged, "the step is shorter than 'step_tolerance'"};
    }
    const double expected = -here.gradient.dot(step) - 0.5 * step.dot(curvature * step);
    CostModel there = evaluator.model_at(at + step, false, here.cost);
    const double decrease = here.cost - there.cost;
    const bool has_gradient = std::isfinite(there.cost) && there.gradient.size() > 0;
    if (has_gradient) update(curvature, step, there.gradient - here.gradient);
    if (!(decrease > 0.0)) {  // also if the cost is not finite
      radius = (has_gradient ? 0.25 : downhill_share(here, step, there.cost)) * length;
      continue;
    }
    at += step;
    here = std::move(there);
    if (decrease < options.cost_tolerance)
      return {OptimizerStatus::kConverged, "improvements are below 'cost_tolerance'"};
    if (decrease < 0.25 * expected)
      radius = 0.5 * length;
    else if (decrease > 0.75 * expected)
      radius = std::max(radius, 2.0 * length);
  }
}

}  // namespace usct::optimizer
