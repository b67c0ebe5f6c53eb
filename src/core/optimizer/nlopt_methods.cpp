#include <nlopt.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <memory>
#include <vector>

#include "optimizer/evaluator.h"

namespace usct::optimizer {
namespace {

using NLopt = std::unique_ptr<nlopt_opt_s, decltype(&nlopt_destroy)>;

/// Largest initial step as a share of the width of the box; BOBYQA needs room for two steps.
constexpr double kStepInBox = 0.45;

nlopt_algorithm algorithm_of(OptimizerMethod method) {
  if (method == OptimizerMethod::kBobyqa) return NLOPT_LN_BOBYQA;
  if (method == OptimizerMethod::kNelderMead) return NLOPT_LN_NELDERMEAD;
  return NLOPT_LN_PRAXIS;
}

/// The callback of NLopt, which is C code that exceptions must not cross: an exception is stored,
/// and thrown again after NLopt has returned.
struct Callback {
  Evaluator& evaluator;
  nlopt_opt_s* nlopt;
  bool fold;
  std::exception_ptr thrown;

  static double call(unsigned size, const double* units, double* /*gradient*/, void* data) {
    return static_cast<Callback*>(data)->cost(
        Eigen::Map<const Eigen::VectorXd>(units, static_cast<Eigen::Index>(size)));
  }

  double cost(const Eigen::VectorXd& units) {
    // Some methods evaluate once more after they were told to stop.
    if (thrown) return HUGE_VAL;
    try {
      return fold ? evaluator.at_folded(units) : evaluator.at(units);
    } catch (...) {
      thrown = std::current_exception();
      nlopt_force_stop(nlopt);
      return HUGE_VAL;
    }
  }
};

Stop meaning_of(nlopt_result code) {
  switch (code) {
    case NLOPT_XTOL_REACHED:
      return {OptimizerStatus::kConverged, "the search is narrower than 'step_tolerance'"};
    case NLOPT_FTOL_REACHED:
      return {OptimizerStatus::kConverged, "improvements are below 'cost_tolerance'"};
    case NLOPT_SUCCESS:
      return {OptimizerStatus::kConverged, "no further improvement was found"};
    case NLOPT_ROUNDOFF_LIMITED:
      return {OptimizerStatus::kConverged, "rounding allows no further step"};
    default:
      return {OptimizerStatus::kFailed,
              "NLopt ended with '" + std::string(nlopt_result_to_string(code)) + "'"};
  }
}

}  // namespace

Stop run_nlopt(Evaluator& evaluator, const OptimizerOptions& options) {
  if (!std::isfinite(evaluator.start_cost()))
    throw Stop{OptimizerStatus::kFailed,
               std::string("the cost is not finite at the start, which ") +
                   method_name(options.method) + " needs"};
  const auto size = static_cast<unsigned>(evaluator.lower().size());
  const NLopt nlopt(nlopt_create(algorithm_of(options.method), size), &nlopt_destroy);
  if (!nlopt) throw std::bad_alloc();

  // The box is folded for Nelder-Mead and PRAXIS. NLopt's Nelder-Mead moves points beyond a face
  // onto it, where the simplex collapses before it reaches the minimum; its PRAXIS takes infinity
  // beyond a face, which spoils its parabolas.
  Callback callback{evaluator, nlopt.get(), options.method != OptimizerMethod::kBobyqa, nullptr};
  nlopt_set_min_objective(nlopt.get(), &Callback::call, &callback);
  if (!callback.fold) {
    nlopt_set_lower_bounds(nlopt.get(), evaluator.lower().data());
    nlopt_set_upper_bounds(nlopt.get(), evaluator.upper().data());
  }
  const Eigen::VectorXd step =
      (kStepInBox * (evaluator.upper() - evaluator.lower())).cwiseMin(options.initial_step);
  nlopt_set_initial_step(nlopt.get(), step.data());
  nlopt_set_xtol_abs1(nlopt.get(), options.step_tolerance);
  nlopt_set_ftol_abs(nlopt.get(), options.cost_tolerance);
  nlopt_srand(options.seed);  // thread-local

  std::vector<double> units(size, 0.0);
  double cost = 0.0;
  const nlopt_result code = nlopt_optimize(nlopt.get(), units.data(), &cost);
  if (callback.thrown) std::rethrow_exception(callback.thrown);
  return meaning_of(code);
}

}  // namespace usct::optimizer
