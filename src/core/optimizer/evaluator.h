#pragma once

#include <Eigen/Core>
#include <deque>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "us_ct_registration/optimizer/optimizer.h"

namespace usct::optimizer {

/// Status and reason with which an optimization ends; thrown to end it at once.
struct Stop {
  OptimizerStatus status = OptimizerStatus::kFailed;
  std::string reason;
};

/// The cost as the methods see it: as a function of the displacement from the start in units of
/// `scale`. It enforces what all methods have in common: box, budget, cancellation, the treatment
/// of costs that are not finite, and the record of the best point.
class Evaluator {
 public:
  /// The evaluator keeps references to all three arguments.
  Evaluator(const OptimizerProblem& problem, const OptimizerOptions& options,
            const OptimizerHooks& hooks);

  /// Evaluates the cost of the start; nothing else does. `start_cost()` is NaN if it is not finite.
  void evaluate_start();
  double start_cost() const { return start_cost_; }

  /// The bounds in units of `scale`, relative to the start; they contain 0.
  const Eigen::VectorXd& lower() const { return lower_; }
  const Eigen::VectorXd& upper() const { return upper_; }

  /// The cost of a point in the box (a point outside by rounding is moved into it). Where the cost
  /// is not finite, the result is the greatest finite cost so far, so that arithmetic on it stays
  /// sound, or the largest number if there is none. Throws Stop.
  double at(const Eigen::VectorXd& units);
  /// The cost for methods without bounds, which may ask for any point: it is mapped into the box
  /// first. Throws Stop.
  double at_folded(const Eigen::VectorXd& units);

  /// Computes the costs of points for which `at_folded` will be called in this order, all at once
  /// if the problem can. It does not count as evaluations, and does not look beyond the budget.
  void look_ahead(const std::vector<Eigen::VectorXd>& units);

  /// The cost with derivatives by the displacement in units of `scale`, of a point in the box; they
  /// may be empty where the cost is not below `below`. It is NaN where it is not finite. Throws
  /// Stop.
  CostModel model_at(const Eigen::VectorXd& units, bool with_curvature, double below);

  OptimizerResult result(const Stop& stop) const;

 private:
  double evaluate(const Eigen::VectorXd& units);
  double cost_of(const Eigen::VectorXd& parameters);
  Eigen::VectorXd in_box(const Eigen::VectorXd& units) const;
  Eigen::VectorXd parameters_at(const Eigen::VectorXd& units) const;
  /// The parameters of a point at which the cost may be evaluated now. Throws Stop.
  Eigen::VectorXd next(const Eigen::VectorXd& units) const;
  void record(const Eigen::VectorXd& parameters, double cost);

  const OptimizerProblem& problem_;
  const OptimizerOptions& options_;
  const OptimizerHooks& hooks_;
  Eigen::VectorXd lower_;
  Eigen::VectorXd upper_;
  double start_cost_ = std::numeric_limits<double>::quiet_NaN();
  double worst_ = std::numeric_limits<double>::quiet_NaN();
  OptimizerResult so_far_;
  /// Points whose costs are known before they are asked for, the next one first.
  std::deque<std::pair<Eigen::VectorXd, double>> ahead_;
};

/// CMA-ES of pagmo, a module (module.h); BOBYQA, Nelder-Mead and PRAXIS of NLopt; Gauss-Newton.
/// evaluate_start() must have been called, except for Gauss-Newton, which evaluates the start with
/// derivatives. They return the status of convergence, or throw what the evaluator throws.
struct CmaEs {
  static constexpr const char* kModule = "cma_es";
  Stop (*run)(Evaluator& evaluator, const OptimizerOptions& options);
};
Stop run_nlopt(Evaluator& evaluator, const OptimizerOptions& options);
Stop run_gauss_newton(Evaluator& evaluator, const OptimizerOptions& options);

}  // namespace usct::optimizer
