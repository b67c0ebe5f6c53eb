#include "us_ct_registration/optimizer/optimizer.h"

#include <array>
#include <chrono>
#include <cmath>
#include <sstream>
#include <utility>

#include "module.h"
#include "optimizer/evaluator.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

constexpr std::array<std::pair<OptimizerMethod, const char*>, 5> kMethods = {{
    {OptimizerMethod::kCmaEs, "cma_es"},
    {OptimizerMethod::kBobyqa, "bobyqa"},
    {OptimizerMethod::kNelderMead, "nelder_mead"},
    {OptimizerMethod::kPraxis, "praxis"},
    {OptimizerMethod::kGaussNewton, "gauss_newton"},
}};

/// The smallest population that pagmo accepts.
constexpr int kSmallestPopulation = 5;
constexpr double kTolerancesInBox = 4.0;

template <typename... Parts>
void require(bool holds, const std::string& source, const Parts&... parts) {
  if (holds) return;
  std::ostringstream violation;
  (violation << ... << parts);
  throw InputError(source, violation.str());
}

void require_room_for_tolerance(const OptimizerProblem& problem, const OptimizerOptions& options) {
  const double width = (problem.upper - problem.lower).cwiseQuotient(problem.scale).minCoeff();
  require(width >= kTolerancesInBox * options.step_tolerance, "optimizer problem", "the box is ",
          width, " units wide, must be at least ", kTolerancesInBox,
          " times 'step_tolerance', which is ", options.step_tolerance);
}

void require_derivatives(const OptimizerProblem& problem, const OptimizerOptions& options) {
  require(options.method != OptimizerMethod::kGaussNewton || problem.model, "optimizer problem",
          "'model' is empty, must be a function for the method gauss_newton");
}

optimizer::Stop run(optimizer::Evaluator& evaluator, const OptimizerOptions& options) {
  if (options.method == OptimizerMethod::kGaussNewton)
    return optimizer::run_gauss_newton(evaluator, options);
  evaluator.evaluate_start();
  return options.method == OptimizerMethod::kCmaEs
             ? module<optimizer::CmaEs>().run(evaluator, options)
             : optimizer::run_nlopt(evaluator, options);
}

}  // namespace

const char* method_name(OptimizerMethod method) {
  for (const auto& [known, name] : kMethods)
    if (known == method) return name;
  return "unknown";
}

OptimizerMethod parse_method(const std::string& name, const std::string& source) {
  std::string all;
  for (const auto& [method, known] : kMethods) {
    if (name == known) return method;
    all += (all.empty() ? "" : ", ") + std::string(known);
  }
  throw InputError(source, "'method' is '" + name + "', must be one of " + all);
}

const char* status_name(OptimizerStatus status) {
  switch (status) {
    case OptimizerStatus::kFailed:
      return "failed";
    case OptimizerStatus::kConverged:
      return "converged";
    case OptimizerStatus::kBudgetExhausted:
      return "budget_exhausted";
    case OptimizerStatus::kCancelled:
      return "cancelled";
  }
  return "failed";
}

void OptimizerProblem::validate(const std::string& source) const {
  require(static_cast<bool>(cost), source, "'cost' is empty, must be a function");
  const Eigen::Index size = start.size();
  require(size >= 2, source, "'start' has ", size, " parameters, must have at least 2");
  const auto require_size = [&](const char* name, const Eigen::VectorXd& vector) {
    require(vector.size() == size, source, "'", name, "' has ", vector.size(),
            " entries, must have ", size, " as 'start'");
  };
  require_size("lower", lower);
  require_size("upper", upper);
  require_size("scale", scale);
  for (Eigen::Index i = 0; i < size; ++i) {
    require(std::isfinite(scale[i]) && scale[i] > 0.0, source, "'scale' of parameter ", i, " is ",
            scale[i], ", must be finite and > 0");
    require(lower[i] < upper[i], source, "'lower' of parameter ", i, " is ", lower[i],
            ", must be < 'upper', which is ", upper[i]);
    require(std::isfinite(lower[i]) == std::isfinite(upper[i]), source, "bounds of parameter ", i,
            " are ", lower[i], " and ", upper[i], ", must be both finite or both infinite");
    require(std::isfinite(start[i]) && lower[i] <= start[i] && start[i] <= upper[i], source,
            "'start' of parameter ", i, " is ", start[i], ", must be finite and within [", lower[i],
            ", ", upper[i], "]");
  }
}

void OptimizerOptions::validate(const std::string& source) const {
  require(max_evaluations >= 0, source, "'max_evaluations' is ", max_evaluations, ", must be >= 0");
  require(std::isfinite(initial_step) && initial_step > 0.0, source, "'initial_step' is ",
          initial_step, ", must be finite and > 0");
  require(step_tolerance > 0.0 && step_tolerance < initial_step, source, "'step_tolerance' is ",
          step_tolerance, ", must be > 0 and < 'initial_step', which is ", initial_step);
  require(std::isfinite(cost_tolerance) && cost_tolerance >= 0.0, source, "'cost_tolerance' is ",
          cost_tolerance, ", must be finite and >= 0");
  require(population == 0 || population >= kSmallestPopulation, source, "'population' is ",
          population, ", must be 0 or >= ", kSmallestPopulation);
}

OptimizerResult optimize(const OptimizerProblem& problem, const OptimizerOptions& options,
                         const OptimizerHooks& hooks) {
  problem.validate("optimizer problem");
  options.validate("optimizer options");
  require_room_for_tolerance(problem, options);
  require_derivatives(problem, options);

  const auto begin = std::chrono::steady_clock::now();
  optimizer::Evaluator evaluator(problem, options, hooks);
  optimizer::Stop stop;
  try {
    stop = run(evaluator, options);
  } catch (const optimizer::Stop& thrown) {
    stop = thrown;
  }
  OptimizerResult result = evaluator.result(stop);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace usct
