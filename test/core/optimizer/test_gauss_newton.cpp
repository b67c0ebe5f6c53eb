#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "core/io/expect_input_error.h"
#include "core/optimizer/test_problems.h"

/// Gauss-Newton on costs with derivatives: sums of squared residuals, whose minima are known.
namespace usct::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

/// A cost |r(x)|^2 with its Gauss-Newton model, without derivatives where it is not below `below`.
using Residuals = std::function<void(const VectorXd& x, VectorXd& residuals, MatrixXd& jacobian)>;

CostModel model_of(const Residuals& residuals_at, const VectorXd& x) {
  VectorXd residuals;
  MatrixXd jacobian;
  residuals_at(x, residuals, jacobian);
  return {residuals.squaredNorm(), 2.0 * jacobian.transpose() * residuals,
          2.0 * jacobian.transpose() * jacobian};
}

OptimizerProblem least_squares(const Residuals& residuals, const VectorXd& start,
                               double bound = 50.0) {
  OptimizerProblem problem =
      problem_of([=](const VectorXd& x) { return model_of(residuals, x).cost; }, start, bound);
  problem.model = [=](const VectorXd& x, bool with_curvature, double below) {
    CostModel model = model_of(residuals, x);
    if (!with_curvature) model.curvature.resize(0, 0);
    if (!(model.cost < below)) model.gradient.resize(0);
    return model;
  };
  return problem;
}

/// x - minimum in rotated axes, times 1 to sqrt(condition).
Residuals rotated_bowl(const VectorXd& minimum, double condition) {
  const auto size = static_cast<int>(minimum.size());
  MatrixXd axes = rotation(size, 99).transpose();
  for (int i = 0; i < size; ++i)
    axes.row(i) *= std::pow(condition, 0.5 * static_cast<double>(i) / (size - 1));
  return [=](const VectorXd& x, VectorXd& residuals, MatrixXd& jacobian) {
    residuals = axes * (x - minimum);
    jacobian = axes;
  };
}

Residuals rosenbrock_residuals() {
  return [](const VectorXd& x, VectorXd& residuals, MatrixXd& jacobian) {
    residuals = Eigen::Vector2d(10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]);
    jacobian = MatrixXd::Zero(2, 2);
    jacobian << -20.0 * x[0], 10.0, -1.0, 0.0;
  };
}

OptimizerOptions gauss_newton(int max_evaluations = 2000) {
  return options_of(OptimizerMethod::kGaussNewton, max_evaluations);
}

TEST(GaussNewton, FindsTheMinimumOfAQuadraticInAFewEvaluations) {
  const VectorXd minimum = point_at(3.0, 6, 1);
  for (const unsigned start : {2U, 3U, 4U, 5U, 6U}) {
    const OptimizerResult result =
        optimize(least_squares(rotated_bowl(minimum, 30.0), minimum + point_at(4.0, 6, start)),
                 gauss_newton());
    EXPECT_EQ(result.status, OptimizerStatus::kConverged) << result.reason;
    EXPECT_LT((*result.best - minimum).norm(), 1e-3);
    EXPECT_LE(result.evaluations, 3);
  }
}

/// The first step is limited, and later ones grow.
TEST(GaussNewton, WalksToAFarMinimum) {
  const VectorXd minimum = point_at(30.0, 6, 1);
  OptimizerOptions options = gauss_newton();
  options.initial_step = 1.0;
  VectorXd second;
  int calls = 0;
  OptimizerProblem problem = least_squares(rotated_bowl(minimum, 5.0), VectorXd::Zero(6));
  problem.model = [&, model = problem.model](const VectorXd& x, bool with_curvature, double below) {
    if (++calls == 2) second = x;
    return model(x, with_curvature, below);
  };
  const OptimizerResult result = optimize(problem, options);
  EXPECT_LT((*result.best - minimum).norm(), 1e-2);
  EXPECT_NEAR(second.norm(), 1.0, 1e-6);
  EXPECT_LE(result.evaluations, 15);
}

TEST(GaussNewton, FollowsTheCurvedValleyOfRosenbrock) {
  OptimizerOptions options = gauss_newton();
  options.step_tolerance = 1e-5;
  const OptimizerResult result =
      optimize(least_squares(rosenbrock_residuals(), Eigen::Vector2d(-1.2, 1.0)), options);
  EXPECT_LT((*result.best - VectorXd::Ones(2)).norm(), 1e-3) << result.best->transpose();
  EXPECT_LE(result.evaluations, 100);
}

/// Noise makes the curvature of Gauss and Newton too large; the gradients tell by how much.
TEST(GaussNewton, CorrectsACurvatureThatIsTooLarge) {
  const VectorXd minimum = point_at(3.0, 6, 1);
  OptimizerProblem problem = least_squares(rotated_bowl(minimum, 3.0), VectorXd::Zero(6));
  problem.model = [model = problem.model](const VectorXd& x, bool with_curvature, double below) {
    CostModel result = model(x, with_curvature, below);
    result.curvature *= 4.0;
    return result;
  };
  const OptimizerResult result = optimize(problem, gauss_newton());
  EXPECT_LT((*result.best - minimum).norm(), 1e-2);
  EXPECT_LE(result.evaluations, 8);  // 4-fold curvature alone needs 25: the error falls to 3/4
}

TEST(GaussNewton, AsksForTheCurvatureAtTheStartOnly) {
  std::vector<bool> asked;
  OptimizerProblem problem = least_squares(rosenbrock_residuals(), Eigen::Vector2d(-1.2, 1.0));
  problem.model = [&, model = problem.model](const VectorXd& x, bool with_curvature, double below) {
    asked.push_back(with_curvature);
    return model(x, with_curvature, below);
  };
  optimize(problem, gauss_newton());
  EXPECT_TRUE(asked.front());
  EXPECT_EQ(std::count(asked.begin(), asked.end(), true), 1);
}

/// A step that leads uphill is not lost: the parabola through both costs says where to try next.
TEST(GaussNewton, ComesBackFromAStepTooFar) {
  const VectorXd minimum = point_at(3.0, 6, 1);
  OptimizerProblem problem = least_squares(rotated_bowl(minimum, 1.0), VectorXd::Zero(6));
  problem.model = [model = problem.model](const VectorXd& x, bool with_curvature, double below) {
    CostModel result = model(x, with_curvature, below);
    result.curvature *= 0.4;  // steps are 2.5 times as long as they should be
    return result;
  };
  OptimizerOptions options = gauss_newton();
  options.initial_step = 20.0;
  const OptimizerResult result = optimize(problem, options);
  EXPECT_LT((*result.best - minimum).norm(), 1e-6);
  EXPECT_LE(result.evaluations, 5);
}

TEST(GaussNewton, FindsAMinimumOnAFaceOfTheBox) {
  VectorXd free(6);
  free << 8, -9, 1, 2, 3, 4;
  const VectorXd minimum = free.cwiseMax(-5.0).cwiseMin(5.0);
  const Residuals bowl = [=](const VectorXd& x, VectorXd& residuals, MatrixXd& jacobian) {
    const VectorXd weights = VectorXd::LinSpaced(6, 1.0, 2.5);
    residuals = weights.cwiseProduct(x - free);
    jacobian = weights.asDiagonal();
  };
  for (const unsigned start : {2U, 3U, 4U, 5U}) {
    bool outside = false;
    OptimizerProblem problem = least_squares(bowl, point_at(4.0, 6, start), 5.0);
    problem.model = [&, model = problem.model](const VectorXd& x, bool with_curvature,
                                               double below) {
      if (x.cwiseAbs().maxCoeff() > 5.0) outside = true;
      return model(x, with_curvature, below);
    };
    const OptimizerResult result = optimize(problem, gauss_newton());
    EXPECT_LT((*result.best - minimum).norm(), 1e-2) << result.best->transpose();
    EXPECT_FALSE(outside);
  }
}

TEST(GaussNewton, ScalesMakeUnequalParametersAlike) {
  const VectorXd minimum = VectorXd::Constant(6, 2.0);
  OptimizerProblem plain = least_squares(rotated_bowl(minimum, 5.0), VectorXd::Zero(6));
  OptimizerProblem scaled = plain;
  scaled.scale.setConstant(0.01);
  scaled.lower *= 0.01;
  scaled.upper *= 0.01;
  scaled.cost = [cost = plain.cost](const VectorXd& x) { return cost(100.0 * x); };
  scaled.model = [model = plain.model](const VectorXd& x, bool with_curvature, double below) {
    CostModel result = model(100.0 * x, with_curvature, below);
    result.gradient *= 100.0;
    result.curvature *= 1e4;
    return result;
  };
  const OptimizerResult a = optimize(plain, gauss_newton());
  const OptimizerResult b = optimize(scaled, gauss_newton());
  EXPECT_NEAR(a.evaluations, b.evaluations, 1);
  EXPECT_LT((*a.best - 100.0 * *b.best).norm(), 1e-9);
}

TEST(GaussNewton, HonoursTheBudgetAndCancellation) {
  for (const int budget : {0, 1, 2, 3, 7}) {
    OptimizerOptions options = gauss_newton(budget);
    options.step_tolerance = 1e-9;
    int asked = 0;
    OptimizerHooks hooks;
    hooks.cancelled = [&] { return ++asked > 5; };
    const OptimizerResult result =
        optimize(least_squares(rosenbrock_residuals(), Eigen::Vector2d(-1.2, 1.0)), options, hooks);
    EXPECT_EQ(result.evaluations, std::min(budget, 5));
    EXPECT_EQ(result.status,
              budget < 5 ? OptimizerStatus::kBudgetExhausted : OptimizerStatus::kCancelled);
    EXPECT_EQ(result.best.has_value(), budget > 0);
  }
}

TEST(GaussNewton, IsStoppedByAWallWithoutACost) {
  const VectorXd minimum = point_at(3.0, 6, 1);
  OptimizerProblem problem =
      least_squares(rotated_bowl(minimum, 4.0), minimum + point_at(8.0, 6, 2));
  const VectorXd start = problem.start;
  problem.model = [=, model = problem.model](const VectorXd& x, bool with_curvature, double below) {
    CostModel result = model(x, with_curvature, below);
    // The whole way to the minimum would lead through a place without a cost.
    if ((x - minimum).norm() < 6.0 && (x - start).norm() > 3.0 && (x - start).norm() < 5.0)
      result.cost = std::numeric_limits<double>::quiet_NaN();
    return result;
  };
  const OptimizerResult result = optimize(problem, gauss_newton());
  EXPECT_TRUE(std::isfinite(result.cost));
  EXPECT_LE(result.cost, problem.model(start, true, kNoLimit).cost);
}

TEST(GaussNewton, FailsWithAReasonAtAStartWithoutACost) {
  OptimizerProblem problem = least_squares(rosenbrock_residuals(), Eigen::Vector2d(0.0, 0.0));
  problem.model = [](const VectorXd&, bool, double) { return CostModel{}; };
  const OptimizerResult result = optimize(problem, gauss_newton());
  EXPECT_EQ(result.status, OptimizerStatus::kFailed);
  EXPECT_NE(result.reason.find("finite"), std::string::npos) << result.reason;
}

TEST(GaussNewton, RefusesACostWithoutDerivatives) {
  const OptimizerProblem problem = problem_of(rosenbrock, Eigen::Vector2d(0.0, 0.0));
  expect_input_error([&] { optimize(problem, gauss_newton()); }, {"model", "gauss_newton"});
}

TEST(GaussNewton, HasAName) {
  EXPECT_STREQ(method_name(OptimizerMethod::kGaussNewton), "gauss_newton");
  EXPECT_EQ(parse_method("gauss_newton", "file"), OptimizerMethod::kGaussNewton);
}

}  // namespace
}  // namespace usct::test
