#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>

#include "us_ct_registration/optimizer/optimizer.h"

namespace usct::optimizer {

/// How an optimization ends. Thrown where it must end at once.
struct Stop {
  OptimizerStatus status = OptimizerStatus::kFailed;
  std::string reason;
};

/// The cost as the methods see it: in units, from the start, which is 0. It keeps the promises that
/// all methods share: box, budget, cancellation, costs that are not finite, the best of all.
class Evaluator {
 public:
  /// All three must outlive it.
  Evaluator(const OptimizerProblem& problem, const OptimizerOptions& options,
            const OptimizerHooks& hooks);

  /// The start's cost is evaluated here, and only here. NaN if it is not finite.
  void evaluate_start();
  double start_cost() const { return start_cost_; }

  /// The box in units; it contains 0.
  const Eigen::VectorXd& lower() const { return lower_; }
  const Eigen::VectorXd& upper() const { return upper_; }

  /// Cost of a point that lies in the box but for rounding. Costs that are not finite come back as
  /// the worst finite one so far, which keeps arithmetic on them sound; without any, as the largest
  /// number. Throws Stop.
  double at(const Eigen::VectorXd& units);
  /// For methods that know no bounds: all of space is folded into the box. Throws Stop.
  double at_folded(const Eigen::VectorXd& units);

  OptimizerResult result(const Stop& stop) const;

 private:
  double evaluate(const Eigen::VectorXd& units);

  const OptimizerProblem& problem_;
  const OptimizerOptions& options_;
  const OptimizerHooks& hooks_;
  Eigen::VectorXd lower_;
  Eigen::VectorXd upper_;
  double start_cost_ = std::numeric_limits<double>::quiet_NaN();
  double worst_ = std::numeric_limits<double>::quiet_NaN();
  OptimizerResult so_far_;
};

/// CMA-ES of pagmo; BOBYQA, Nelder-Mead and PRAXIS of NLopt. After evaluate_start(). They return
/// how they converged, or throw what the evaluator throws.
Stop run_cma_es(Evaluator& evaluator, const OptimizerOptions& options);
Stop run_nlopt(Evaluator& evaluator, const OptimizerOptions& options);

}  // namespace usct::optimizer
