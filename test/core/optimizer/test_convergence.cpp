#include <gtest/gtest.h>

#include "core/optimizer/test_problems.h"
#include "us_ct_registration/geometry/angles.h"

/// Each method finds minima that are known from the formula, from several starts.
namespace usct::test {
namespace {

class EachMethod : public testing::TestWithParam<OptimizerMethod> {};

INSTANTIATE_TEST_SUITE_P(Optimizer, EachMethod, testing::ValuesIn(all_methods()), name_of);

/// All but PRAXIS: Brent's method puts parabolas through noisy points and promises nothing there.
class EachMethodForNoise : public testing::TestWithParam<OptimizerMethod> {};
INSTANTIATE_TEST_SUITE_P(Optimizer, EachMethodForNoise,
                         testing::Values(OptimizerMethod::kCmaEs, OptimizerMethod::kBobyqa,
                                         OptimizerMethod::kNelderMead),
                         name_of);

void expect_minimum(const OptimizerResult& result, const Eigen::VectorXd& minimum,
                    double tolerance) {
  ASSERT_TRUE(result.best) << result.reason;
  EXPECT_EQ(result.status, OptimizerStatus::kConverged) << result.reason;
  EXPECT_LT((*result.best - minimum).norm(), tolerance)
      << "at " << result.best->transpose() << " after " << result.evaluations << ", "
      << result.reason;
}

void record(const std::string& key, int evaluations) {
  testing::Test::RecordProperty(key, evaluations);
}

TEST_P(EachMethod, FindsTheMinimumOfQuadraticsInRotatedCoordinates) {
  const Eigen::VectorXd minimum = point_at(3.0, 6, 1);
  int most = 0;
  for (const unsigned start : {2U, 3U, 4U, 5U, 6U}) {
    for (const double distance : {1.0, 10.0, 20.0}) {
      SCOPED_TRACE("start " + std::to_string(start) + " at " + std::to_string(distance));
      const OptimizerResult result = optimize(
          problem_of(rotated_quadratic(minimum, 30.0), minimum + point_at(distance, 6, start)),
          options_of(GetParam()));
      expect_minimum(result, minimum, 0.02);
      most = std::max(most, result.evaluations);
    }
  }
  record("most_evaluations", most);
}

TEST_P(EachMethod, FollowsTheCurvedValleyOfRosenbrock) {
  for (const int size : {2, 4}) {
    for (const unsigned start : {2U, 3U, 4U}) {
      SCOPED_TRACE(std::to_string(size) + " parameters, start " + std::to_string(start));
      OptimizerOptions options = options_of(GetParam());
      options.initial_step = 0.5;
      options.step_tolerance = 1e-6;
      const Eigen::VectorXd minimum = Eigen::VectorXd::Ones(size);
      const OptimizerResult result =
          optimize(problem_of(rosenbrock, minimum + point_at(1.0, size, start)), options);
      expect_minimum(result, minimum, 0.02);
      record("evaluations_" + std::to_string(size), result.evaluations);
    }
  }
}

TEST_P(EachMethod, FindsAMinimumOnAFaceOfTheBox) {
  // Without the box the minimum is at (8, -9, 1, 2, 3, 4); axes do not mix, so that with the box it
  // is there, clamped.
  Eigen::VectorXd free(6);
  free << 8, -9, 1, 2, 3, 4;
  const auto cost = [free](const Eigen::VectorXd& x) {
    return (x - free).cwiseAbs2().dot(Eigen::VectorXd::LinSpaced(6, 1.0, 6.0));
  };
  const Eigen::VectorXd minimum = free.cwiseMax(-5.0).cwiseMin(5.0);
  for (const unsigned start : {2U, 3U, 4U, 5U}) {
    SCOPED_TRACE("start " + std::to_string(start));
    expect_minimum(optimize(problem_of(cost, point_at(4.0, 6, start), 5.0), options_of(GetParam())),
                   minimum, 0.02);
  }
}

TEST_P(EachMethod, StartsOnACornerOfTheBox) {
  const Eigen::VectorXd minimum = point_at(3.0, 6, 1);
  expect_minimum(
      optimize(problem_of(rotated_quadratic(minimum, 5.0), Eigen::VectorXd::Constant(6, 5.0), 5.0),
               options_of(GetParam())),
      minimum, 0.02);
}

TEST_P(EachMethod, NeedsNoBounds) {
  const Eigen::VectorXd minimum = point_at(3.0, 6, 1);
  const double infinite = std::numeric_limits<double>::infinity();
  OptimizerProblem problem =
      problem_of(rotated_quadratic(minimum, 5.0), minimum + point_at(10.0, 6, 2), infinite);
  problem.lower[2] = -30.0;
  problem.upper[2] = 30.0;
  expect_minimum(optimize(problem, options_of(GetParam())), minimum, 0.02);
}

TEST_P(EachMethod, ScalesMakeUnequalParametersAlike) {
  // Rotations in radians beside translations in millimetres.
  Eigen::VectorXd scale(6);
  scale << 0.02, 0.03, 0.02, 1.0, 2.0, 1.0;
  const Eigen::VectorXd minimum_in_units = point_at(3.0, 6, 1);
  const Cost in_units = rotated_quadratic(minimum_in_units, 10.0);
  OptimizerProblem problem =
      problem_of([&](const Eigen::VectorXd& x) { return in_units(x.cwiseQuotient(scale)); },
                 scale.cwiseProduct(point_at(10.0, 6, 2)), 100.0);
  problem.scale = scale;
  OptimizerResult result = optimize(problem, options_of(GetParam()));
  ASSERT_TRUE(result.best);
  result.best = result.best->cwiseQuotient(scale);
  expect_minimum(result, minimum_in_units, 0.02);
}

TEST_P(EachMethod, ACostToleranceEndsItEarlier) {
  const Eigen::VectorXd minimum = point_at(3.0, 6, 1);
  const OptimizerProblem problem =
      problem_of(rotated_quadratic(minimum, 10.0), minimum + point_at(10.0, 6, 2));
  OptimizerOptions options = options_of(GetParam());
  options.step_tolerance = 1e-8;
  const OptimizerResult to_the_end = optimize(problem, options);
  options.cost_tolerance = 1e-2;
  const OptimizerResult early = optimize(problem, options);
  EXPECT_EQ(early.status, OptimizerStatus::kConverged);
  EXPECT_NE(early.reason.find("cost_tolerance"), std::string::npos) << early.reason;
  EXPECT_LT(early.evaluations, to_the_end.evaluations);
  EXPECT_LT(early.cost, 1.0);
}

TEST_P(EachMethod, EndsOnAPlateau) {
  const OptimizerResult result =
      optimize(problem_of([](const Eigen::VectorXd&) { return 0.7; }, point_at(3.0, 6, 2)),
               options_of(GetParam(), 5000));
  EXPECT_EQ(result.cost, 0.7);
  EXPECT_NE(result.status, OptimizerStatus::kFailed) << result.reason;
  EXPECT_LE(result.evaluations, 5000);
  record("evaluations", result.evaluations);
}

TEST_P(EachMethodForNoise, Improves) {
  // A bowl with noise that hides what lies within 10 sqrt(2 * 0.02) = 2 mm of its minimum.
  const Cost cost = [](const Eigen::VectorXd& x) {
    return x.squaredNorm() / 100.0 + 0.02 * rough(x);
  };
  for (const unsigned start : {2U, 3U, 4U, 5U}) {
    const OptimizerResult result =
        optimize(problem_of(cost, point_at(15.0, 6, start)), options_of(GetParam(), 1500));
    ASSERT_TRUE(result.best);
    EXPECT_LT(result.best->norm(), 4.0) << "start " << start << ": " << result.reason;
  }
}

/// A bowl in which egg-box minima 2 mm apart trap whoever sees only slopes.
double rastrigin(const Eigen::VectorXd& x) {
  const double period_mm = 2.0;
  return x.squaredNorm() / 100.0 + 0.05 * (1.0 - (x.array() * (2.0 * kPi / period_mm)).cos()).sum();
}

TEST(CmaEs, GoesThroughLocalMinimaToTheGlobalOne) {
  int found = 0;
  for (const std::uint32_t seed : {1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U}) {
    OptimizerOptions options = options_of(OptimizerMethod::kCmaEs);
    options.seed = seed;
    options.population = 40;
    const OptimizerResult result =
        optimize(problem_of(rastrigin, point_at(15.0, 6, seed + 10)), options);
    ASSERT_TRUE(result.best);
    if (result.best->norm() < 0.1) ++found;
  }
  EXPECT_GE(found, 7) << "of 8";
}

TEST(CmaEs, FindsTheMinimumOfTerraces) {
  // Discontinuous everywhere that matters, flat elsewhere: the height of steps 0.5 mm wide.
  const Cost cost = [](const Eigen::VectorXd& x) { return (x.array() / 0.5).round().abs().sum(); };
  for (const unsigned start : {2U, 3U, 4U, 5U}) {
    const OptimizerResult result =
        optimize(problem_of(cost, point_at(15.0, 6, start)), options_of(OptimizerMethod::kCmaEs));
    ASSERT_TRUE(result.best);
    EXPECT_LE(result.cost, 1.0) << "start " << start << ": " << result.best->transpose();
  }
}

TEST(CmaEs, OrderOfCostsIsAllThatCounts) {
  // A jump from finite to huge costs changes nothing for a method that ranks.
  const Eigen::VectorXd minimum = point_at(3.0, 6, 1);
  const Cost bowl = rotated_quadratic(minimum, 10.0);
  const OptimizerProblem plain = problem_of(bowl, point_at(10.0, 6, 2));
  const OptimizerProblem warped =
      problem_of([bowl](const Eigen::VectorXd& x) { return std::sinh(std::cbrt(bowl(x))) - 7.0; },
                 plain.start);
  const OptimizerOptions options = options_of(OptimizerMethod::kCmaEs, 900);
  const OptimizerResult a = optimize(plain, options);
  const OptimizerResult b = optimize(warped, options);
  EXPECT_EQ(*a.best, *b.best);
}

TEST(Bobyqa, NeedsFewEvaluationsWhereTheCostIsSmooth) {
  // The purpose of BOBYQA: a pose in about a hundred evaluations.
  const Eigen::VectorXd minimum = point_at(3.0, 6, 1);
  OptimizerOptions options = options_of(OptimizerMethod::kBobyqa);
  options.step_tolerance = 0.01;
  const OptimizerResult result = optimize(
      problem_of(rotated_quadratic(minimum, 10.0), minimum + point_at(10.0, 6, 2)), options);
  expect_minimum(result, minimum, 0.05);
  EXPECT_LE(result.evaluations, 150);
}

}  // namespace
}  // namespace usct::test
