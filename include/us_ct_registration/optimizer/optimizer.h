#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

/// Minimisation, with derivatives or without. An optimizer sees a vector of parameters and a scalar
/// cost, and knows nothing of poses or images.
namespace usct {

enum class OptimizerMethod {
  /// Covariance matrix adaptation (Hansen 2006), the optimizer of the thesis: it searches globally
  /// within a few initial steps, and tolerates noise and discontinuities, since it uses only the
  /// order of the costs.
  kCmaEs,
  /// Quadratic models in a trust region (Powell 2009); needs by far the fewest evaluations where
  /// the cost is smooth.
  kBobyqa,
  /// Downhill simplex (Nelder and Mead 1965).
  kNelderMead,
  /// Principal axes (Brent 1972), Powell's direction sets made robust.
  kPraxis,
  /// Gauss-Newton steps in a trust region (Levenberg 1944, Marquardt 1963, Moré 1978); needs a
  /// cost with derivatives (OptimizerProblem::model), and finds a near minimum in a few
  /// evaluations. The curvature is that of the start, corrected by the change of the gradient over
  /// each step (BFGS, scaled once).
  kGaussNewton,
};

/// "cma_es", "bobyqa", "nelder_mead", "praxis", "gauss_newton".
const char* method_name(OptimizerMethod method);

/// Throws InputError, naming `source`, for any other text.
OptimizerMethod parse_method(const std::string& name, const std::string& source);

/// A cost near a point: its value, its gradient and, if it was asked for, a positive semidefinite
/// approximation of its second derivative. The derivatives do not count where the cost is not
/// finite.
struct CostModel {
  double cost = std::numeric_limits<double>::quiet_NaN();
  Eigen::VectorXd gradient;
  Eigen::MatrixXd curvature;
};

/// The cost, the start and the bounds. All vectors have one entry per parameter, and there are at
/// least two parameters.
struct OptimizerProblem {
  /// The function to minimise. It is never called outside the box, and only from the thread that
  /// called `optimize`. A value that is not finite means that the cost is undefined at that point;
  /// it counts as worse than every finite cost. An exception ends the optimization and reaches the
  /// caller.
  std::function<double(const Eigen::VectorXd&)> cost;
  /// The cost with its derivatives, called like `cost`; its values have the same bits. Derivatives
  /// may be empty where the cost is not below `below`, since the method does not go there. Only
  /// OptimizerMethod::kGaussNewton needs it; empty for a cost without derivatives.
  std::function<CostModel(const Eigen::VectorXd&, bool with_curvature, double below)> model;
  /// The costs of several points, called like `cost`; the values have the same bits. CMA-ES asks
  /// for a generation at once, where that is faster than one point after the other; empty if it is
  /// not.
  std::function<std::vector<double>(const std::vector<Eigen::VectorXd>&)> costs;
  Eigen::VectorXd start;
  /// Bounds of the box, which includes its faces; both infinite for a parameter without bounds.
  Eigen::VectorXd lower;
  Eigen::VectorXd upper;
  /// The unit of each parameter for the steps and tolerances below: changes of one unit in
  /// different parameters should have about the same effect.
  Eigen::VectorXd scale;

  /// Throws InputError, naming `source`, unless there is a cost, sizes agree, there are at least
  /// two parameters, lower < upper with both finite or both infinite, the start is finite and in
  /// the box, and scales are finite and > 0.
  void validate(const std::string& source) const;
};

struct OptimizerOptions {
  OptimizerMethod method = OptimizerMethod::kCmaEs;
  /// Seed of CMA-ES and of the random steps of PRAXIS; the other methods draw no random numbers.
  std::uint32_t seed = 1;
  /// Greatest number of evaluations of the cost, with derivatives or without, never exceeded; >= 0.
  int max_evaluations = 2000;
  /// First step, in the units of `scale`; > 0. It is the standard deviation of the first population
  /// of CMA-ES, the first trust region of BOBYQA and of Gauss-Newton, the edge of the first
  /// simplex, or the longest step of PRAXIS. A third of the expected distance to the optimum is a
  /// good value for CMA-ES; the default suits starts within 15 mm. Where the box is narrower
  /// than 2.2 steps, the methods of NLopt start with 45 % of its width.
  double initial_step = 5.0;
  /// Tolerance of the position, in the units of `scale`; > 0, below `initial_step`. The search has
  /// converged when it has contracted to this: the standard deviation of each parameter over a
  /// population, the radius of the trust region, the extent of the simplex, the change over an
  /// iteration of PRAXIS, or the step of Gauss-Newton. The box must be at least four times as wide.
  double step_tolerance = 0.01;
  /// Tolerance of the cost; >= 0. The methods of NLopt and Gauss-Newton have converged when an
  /// improvement is below it. CMA-ES has converged when the costs of its population and the best
  /// costs of the last 10 + 30 n / population generations differ by no more than it; with 0, only
  /// if all of these are equal.
  double cost_tolerance = 0.0;
  /// Evaluations per generation of CMA-ES; 0 takes Hansen's 4 + floor(3 ln n), which is 9 for a
  /// pose; otherwise >= 5. A larger population is slower and escapes more local optima. The thesis
  /// states neither population nor step.
  int population = 0;

  /// Throws InputError, naming `source`, unless all fields satisfy the constraints above.
  void validate(const std::string& source) const;
};

/// Callbacks while an optimization runs; both may be empty. They are called from the thread that
/// called `optimize`, and their exceptions reach the caller.
struct OptimizerHooks {
  /// Called before each evaluation; the optimization ends when it returns true.
  std::function<bool()> cancelled;
  /// Called after each evaluation, with the number of evaluations and the lowest cost so far (NaN
  /// before the first finite one).
  std::function<void(int evaluations, double best_cost)> progress;
};

enum class OptimizerStatus {
  kFailed,           // the reason says why
  kConverged,        // a tolerance was reached
  kBudgetExhausted,  // max_evaluations were made; the result is the best so far
  kCancelled,        // the caller ended it; the result is the best so far
};

/// "failed", "converged", "budget_exhausted", "cancelled".
const char* status_name(OptimizerStatus status);

/// The result of an optimization. It starts as failed; nothing is valid by default.
struct OptimizerResult {
  OptimizerStatus status = OptimizerStatus::kFailed;
  /// The reason of the status in words.
  std::string reason = "not run";
  /// The parameters with the lowest cost of all that were evaluated, the start included. Unset if
  /// no cost was finite or nothing was evaluated.
  std::optional<Eigen::VectorXd> best;
  /// The cost of `best`, never above that of the start; NaN if `best` is unset.
  double cost = std::numeric_limits<double>::quiet_NaN();
  int evaluations = 0;
  double seconds = 0.0;
};

/// Minimises the cost. The start is evaluated first; methods other than CMA-ES need a finite cost
/// there, and fail with a reason otherwise.
///
/// The result is deterministic: the same problem, options and seed give the same bits, even if
/// other threads run optimizations at the same time. (The random generator of NLopt, which PRAXIS
/// uses, is seeded anew each time; each thread has its own.) BOBYQA and Gauss-Newton handle bounds
/// themselves. For the other methods each bounded parameter is a sine of an unbounded one, with
/// unit slope in the middle of the box, so that steps shorten towards a face and a minimum on a
/// face is found like any other.
///
/// Throws InputError if the problem or the options are invalid, or do not suit each other, as
/// Gauss-Newton and a cost without derivatives.
OptimizerResult optimize(const OptimizerProblem& problem, const OptimizerOptions& options,
                         const OptimizerHooks& hooks = {});

}  // namespace usct
