#include <algorithm>
#include <cmath>
#include <deque>
#include <pagmo/algorithms/cmaes.hpp>
#include <pagmo/population.hpp>
#include <pagmo/problem.hpp>
#include <utility>

#include "optimizer/evaluator.h"

namespace usct::optimizer {
namespace {

using pagmo::vector_double;

// This file frees Eigen matrices that pagmo's library allocated, so both must align memory in the
// same way. -mavx or -march=native for this project break that. The address sanitizer does not, if
// everything is compiled with -DEIGEN_MALLOC_ALREADY_ALIGNED=1.
static_assert(EIGEN_MALLOC_ALREADY_ALIGNED, "Eigen allocates memory here unlike in pagmo");

/// Answers pagmo, which asks for one cost after the other.
struct Answers {
  Evaluator& evaluator;
  /// While the points of a generation are listed, they are not evaluated.
  bool only_lists = false;
  std::vector<Eigen::VectorXd> listed;
};

/// Adapts the evaluator to pagmo's interface of a problem, which must be copyable.
struct PagmoProblem {
  vector_double fitness(const vector_double& units) const {
    const auto size = static_cast<Eigen::Index>(units.size());
    const Eigen::Map<const Eigen::VectorXd> point(units.data(), size);
    if (!answers->only_lists) return {answers->evaluator.at_folded(point)};
    answers->listed.emplace_back(point);
    return {0.0};
  }
  /// pagmo uses these bounds only for the standard deviation of its first samples, which is the
  /// width of the box times the initial step.
  std::pair<vector_double, vector_double> get_bounds() const {
    return {vector_double(dimension, -0.5), vector_double(dimension, 0.5)};
  }

  Answers* answers = nullptr;
  std::size_t dimension = 2;
};

/// The points of the next generation. They do not depend on their own costs, and copies of the
/// algorithm and its population draw the same random numbers, so that a copy can be asked.
std::vector<Eigen::VectorXd> next_generation(pagmo::cmaes cma_es,
                                             const pagmo::population& population,
                                             Answers& answers) {
  answers.listed.clear();
  answers.only_lists = true;
  cma_es.evolve(population);
  answers.only_lists = false;
  return answers.listed;
}

std::size_t default_population(std::size_t dimension) {
  return 4 + static_cast<std::size_t>(3.0 * std::log(static_cast<double>(dimension)));
}

/// Largest standard deviation of a parameter over the population.
double spread(const std::vector<vector_double>& points) {
  const auto size = static_cast<Eigen::Index>(points.front().size());
  Eigen::ArrayXd sum = Eigen::ArrayXd::Zero(size);
  Eigen::ArrayXd sum_of_squares = sum;
  for (const vector_double& point : points) {
    const Eigen::ArrayXd difference = Eigen::Map<const Eigen::ArrayXd>(point.data(), size) -
                                      Eigen::Map<const Eigen::ArrayXd>(points[0].data(), size);
    sum += difference;
    sum_of_squares += difference.square();
  }
  const auto count = static_cast<double>(points.size());
  return std::sqrt((sum_of_squares / count - (sum / count).square()).maxCoeff());
}

/// Hansen's criterion TolFun: costs have not changed by more than a tolerance over many
/// generations.
class Stagnation {
 public:
  Stagnation(double tolerance, std::size_t generations)
      : tolerance_(tolerance), generations_(generations) {}

  bool reached(const std::vector<vector_double>& costs) {
    const auto [low, high] = std::minmax_element(costs.begin(), costs.end());
    bests_.push_back((*low)[0]);
    if (bests_.size() <= generations_) return false;
    bests_.pop_front();
    const auto [best_low, best_high] = std::minmax_element(bests_.begin(), bests_.end());
    return std::max((*high)[0], *best_high) - std::min((*low)[0], *best_low) <= tolerance_;
  }

 private:
  double tolerance_;
  std::size_t generations_;
  std::deque<double> bests_;
};

Stop run_cma_es(Evaluator& evaluator, const OptimizerOptions& options) {
  const auto dimension = static_cast<std::size_t>(evaluator.lower().size());
  const std::size_t size = options.population > 0
                               ? static_cast<std::size_t>(options.population)
                               : std::max<std::size_t>(5, default_population(dimension));
  // pagmo takes the best member of the population for the mean of the first generation. All members
  // are the start with its known cost, so that this evaluates nothing.
  const double start_cost = std::isfinite(evaluator.start_cost())
                                ? evaluator.start_cost()
                                : std::numeric_limits<double>::max();
  Answers answers{evaluator, false, {}};
  pagmo::population population(pagmo::problem(PagmoProblem{&answers, dimension}), 0u, options.seed);
  for (std::size_t i = 0; i < size; ++i)
    population.push_back(vector_double(dimension, 0.0), {start_cost});

  // pagmo runs one generation at a time and keeps its state. Its own stopping criteria look at one
  // random sample (xtol) or one generation (ftol), and would stop on a plateau at once.
  constexpr double kAutomatic = -1.0;
  constexpr double kNever = 0.0;
  const pagmo::cmaes cma_es(1u, kAutomatic, kAutomatic, kAutomatic, kAutomatic,
                            options.initial_step, kNever, kNever, true, false, options.seed);
  Stagnation stagnation(options.cost_tolerance, 10 + (30 * dimension + size - 1) / size);
  while (true) {
    evaluator.look_ahead(next_generation(cma_es, population, answers));
    population = cma_es.evolve(std::move(population));
    if (spread(population.get_x()) < options.step_tolerance)
      return {OptimizerStatus::kConverged, "the population is narrower than 'step_tolerance'"};
    if (stagnation.reached(population.get_f()))
      return {OptimizerStatus::kConverged, "the costs lie within 'cost_tolerance'"};
  }
}

}  // namespace
}  // namespace usct::optimizer

extern "C" const void* usct_module() {
  static const usct::optimizer::CmaEs functions{usct::optimizer::run_cma_es};
  return &functions;
}
