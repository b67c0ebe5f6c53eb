#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "us_ct_registration/optimizer/optimizer.h"

/// Costs whose minima are known from their formulas.
namespace usct::test {

using Cost = std::function<double(const Eigen::VectorXd&)>;

inline const std::vector<OptimizerMethod>& all_methods() {
  static const std::vector<OptimizerMethod> methods = {
      OptimizerMethod::kCmaEs, OptimizerMethod::kBobyqa, OptimizerMethod::kNelderMead,
      OptimizerMethod::kPraxis};
  return methods;
}

/// In a box of +-`bound` with unit scales.
inline OptimizerProblem problem_of(Cost cost, const Eigen::VectorXd& start, double bound = 50.0) {
  OptimizerProblem problem;
  problem.cost = std::move(cost);
  problem.start = start;
  problem.lower = Eigen::VectorXd::Constant(start.size(), -bound);
  problem.upper = Eigen::VectorXd::Constant(start.size(), bound);
  problem.scale = Eigen::VectorXd::Ones(start.size());
  return problem;
}

inline OptimizerOptions options_of(OptimizerMethod method, int max_evaluations = 20000) {
  OptimizerOptions options;
  options.method = method;
  options.max_evaluations = max_evaluations;
  options.step_tolerance = 1e-3;
  return options;
}

/// A rotation of n dimensions that mixes all axes.
inline Eigen::MatrixXd rotation(int size, unsigned seed) {
  std::mt19937 random(seed);
  Eigen::MatrixXd matrix(size, size);
  for (Eigen::Index i = 0; i < matrix.size(); ++i)
    matrix.data()[i] = static_cast<double>(random()) / 4294967296.0 - 0.5;
  return matrix.householderQr().householderQ();
}

/// A point at the given distance from the origin, in a direction of its own.
inline Eigen::VectorXd point_at(double distance, int size, unsigned seed) {
  return distance * rotation(size, seed).col(0);
}

/// (x - minimum)^T H (x - minimum), H with eigenvalues from 1 to `condition` in rotated axes.
inline Cost rotated_quadratic(const Eigen::VectorXd& minimum, double condition) {
  const auto size = static_cast<int>(minimum.size());
  Eigen::VectorXd eigenvalues(size);
  for (int i = 0; i < size; ++i)
    eigenvalues[i] = std::pow(condition, static_cast<double>(i) / (size - 1));
  const Eigen::MatrixXd axes = rotation(size, 99);
  const Eigen::MatrixXd hessian = axes * eigenvalues.asDiagonal() * axes.transpose();
  return [=](const Eigen::VectorXd& x) { return (x - minimum).dot(hessian * (x - minimum)); };
}

/// Minimum 0 at (1, ..., 1), at the end of a curved valley.
inline double rosenbrock(const Eigen::VectorXd& x) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i + 1 < x.size(); ++i)
    sum += 100.0 * std::pow(x[i + 1] - x[i] * x[i], 2) + std::pow(1.0 - x[i], 2);
  return sum;
}

/// Uniform in [-1, 1), a function of the point alone.
inline double rough(const Eigen::VectorXd& x) {
  const double value = std::sin(x.dot(Eigen::VectorXd::LinSpaced(x.size(), 12.9, 78.2))) * 43758.5;
  return 2.0 * (value - std::floor(value)) - 1.0;
}

/// The name of a test that runs with each method.
inline std::string name_of(const testing::TestParamInfo<OptimizerMethod>& info) {
  return method_name(info.param);
}

}  // namespace usct::test
