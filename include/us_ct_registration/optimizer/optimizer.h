#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>

/// Minimisation without derivatives. An optimizer sees a vector and a number; what they mean is
/// known elsewhere.
namespace usct {

enum class OptimizerMethod {
  /// Covariance matrix adaptation (Hansen 2006), the thesis' optimizer: global within a few initial
  /// steps, indifferent to noise and jumps, since only the order of costs counts.
  kCmaEs,
  /// Quadratic models in a trust region (Powell 2009): by far the fewest evaluations where the cost
  /// is smooth.
  kBobyqa,
  /// Downhill simplex (Nelder and Mead 1965).
  kNelderMead,
  /// Principal axes (Brent 1972), Powell's direction sets made robust.
  kPraxis,
};

/// "cma_es", "bobyqa", "nelder_mead", "praxis".
const char* method_name(OptimizerMethod method);

/// Throws InputError, naming `source`, for any other text.
OptimizerMethod parse_method(const std::string& name, const std::string& source);

/// A cost, where to start, and where to stay. All vectors have one entry per parameter, two at
/// least.
struct OptimizerProblem {
  /// Minimised. Never called outside the box, and only from the thread that optimizes. A cost that
  /// is not finite means that there is none here, and counts as worse than all that are. What it
  /// throws ends the optimization and reaches the caller.
  std::function<double(const Eigen::VectorXd&)> cost;
  Eigen::VectorXd start;
  /// The box, faces included; both infinite where there are no bounds.
  Eigen::VectorXd lower;
  Eigen::VectorXd upper;
  /// How far each parameter must change for about the same effect: one unit of the steps and
  /// tolerances below.
  Eigen::VectorXd scale;

  /// Throws InputError, naming `source`, unless there is a cost, sizes agree, there are two
  /// parameters at least, lower < upper with both finite or neither, the start is finite and in the
  /// box, and scales are finite and > 0.
  void validate(const std::string& source) const;
};

struct OptimizerOptions {
  OptimizerMethod method = OptimizerMethod::kCmaEs;
  /// Of CMA-ES and of PRAXIS' random steps; the other methods draw no random numbers.
  std::uint32_t seed = 1;
  /// Calls of the cost, exactly; >= 0.
  int max_evaluations = 2000;
  /// Units; > 0. Standard deviation of the first population of CMA-ES, first trust region, edges of
  /// the first simplex, longest step of PRAXIS. A third of the expected distance to the optimum is
  /// a good value for CMA-ES; the default suits starts within 15 mm. Where the box is narrower than
  /// 2.2 steps, NLopt's methods start with 45 % of its width.
  double initial_step = 5.0;
  /// Units; > 0, below `initial_step`. Converged when the search has contracted to this: standard
  /// deviation of each parameter over a population, radius of the trust region, extent of the
  /// simplex, change over an iteration of PRAXIS. The box must be four times as wide.
  double step_tolerance = 0.01;
  /// In the unit of the cost; >= 0. Converged when an improvement is below this (NLopt's methods),
  /// or when the population's costs and the best of each of the last 10 + 30 n / population
  /// generations lie within it (CMA-ES). 0: only when CMA-ES has seen nothing but one value so
  /// long.
  double cost_tolerance = 0.0;
  /// Costs per generation of CMA-ES; 0 takes Hansen's 4 + floor(3 ln n), 9 for a pose; otherwise
  /// >= 5. Larger is slower and escapes more local optima. The thesis states neither population nor
  /// step.
  int population = 0;

  /// Throws InputError, naming `source`, unless all is as said above.
  void validate(const std::string& source) const;
};

/// What a caller may do while an optimization runs; both may be empty. Called from the thread that
/// optimizes. What they throw reaches the caller.
struct OptimizerHooks {
  /// Asked before each evaluation; true ends the optimization.
  std::function<bool()> cancelled;
  /// Told after each evaluation: how many there were, and the lowest cost so far (NaN before the
  /// first finite one).
  std::function<void(int evaluations, double best_cost)> progress;
};

enum class OptimizerStatus {
  kFailed,           // the reason says why
  kConverged,        // a tolerance was reached
  kBudgetExhausted,  // max_evaluations were made; the best so far
  kCancelled,        // by the caller; the best so far
};

/// "failed", "converged", "budget_exhausted", "cancelled".
const char* status_name(OptimizerStatus status);

/// What an optimization hands back. It starts as failed; nothing is valid by default.
struct OptimizerResult {
  OptimizerStatus status = OptimizerStatus::kFailed;
  /// In words, for people.
  std::string reason = "not run";
  /// The parameters with the lowest cost of all that were evaluated, the start included; none if no
  /// cost was finite or nothing was evaluated.
  std::optional<Eigen::VectorXd> best;
  /// Of `best`, never above the start's; NaN without one.
  double cost = std::numeric_limits<double>::quiet_NaN();
  int evaluations = 0;
  double seconds = 0.0;
};

/// Minimises; the start is evaluated first. Methods other than CMA-ES need a finite cost there, and
/// fail with a reason otherwise.
///
/// Deterministic: the same problem, options and seed give the same bits, however many optimizations
/// run in other threads at the same time. (NLopt's generator, which PRAXIS uses, is seeded anew;
/// each thread has its own.) Only BOBYQA knows bounds; for the others each parameter is a sine of
/// theirs (of unit slope in the middle of the box), so that steps shorten towards a face and a
/// minimum on it is found like any other.
///
/// Throws InputError if the problem, the options, or the two together are invalid.
OptimizerResult optimize(const OptimizerProblem& problem, const OptimizerOptions& options,
                         const OptimizerHooks& hooks = {});

}  // namespace usct
