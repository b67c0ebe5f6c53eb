#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <stdexcept>
#include <thread>

#include "core/io/expect_input_error.h"
#include "core/optimizer/test_problems.h"

/// Properties of every method, whatever the cost: budget, box, cancellation, costs that are not
/// finite, the same bits.
namespace usct::test {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

class Promise : public testing::TestWithParam<OptimizerMethod> {};

INSTANTIATE_TEST_SUITE_P(Optimizer, Promise, testing::ValuesIn(all_methods()), name_of);

OptimizerProblem bowl_problem() {
  return problem_of(rotated_quadratic(point_at(3.0, 6, 1), 10.0), point_at(10.0, 6, 2));
}

/// The method may not stop by itself.
OptimizerOptions restless(OptimizerMethod method, int max_evaluations) {
  OptimizerOptions options = options_of(method, max_evaluations);
  options.step_tolerance = 1e-9;
  return options;
}

TEST_P(Promise, TheBudgetIsHonouredExactly) {
  for (const int budget : {1, 2, 7, 13, 50, 64}) {
    int calls = 0;
    OptimizerProblem problem = bowl_problem();
    const Cost bowl = problem.cost;
    problem.cost = [&](const Eigen::VectorXd& x) {
      ++calls;
      return bowl(x);
    };
    const OptimizerResult result = optimize(problem, restless(GetParam(), budget));
    EXPECT_EQ(calls, budget);
    EXPECT_EQ(result.evaluations, budget);
    EXPECT_EQ(result.status, OptimizerStatus::kBudgetExhausted);
    ASSERT_TRUE(result.best);
    EXPECT_LE(result.cost, bowl(problem.start));
    EXPECT_EQ(result.cost, bowl(*result.best));
  }
}

TEST_P(Promise, ABudgetOfZeroGivesAReasonAndNoParameters) {
  const OptimizerResult result = optimize(bowl_problem(), restless(GetParam(), 0));
  EXPECT_EQ(result.status, OptimizerStatus::kBudgetExhausted);
  EXPECT_NE(result.reason.find("0 evaluations"), std::string::npos) << result.reason;
  EXPECT_FALSE(result.best);
  EXPECT_TRUE(std::isnan(result.cost));
  EXPECT_EQ(result.evaluations, 0);
}

TEST_P(Promise, NoCostIsAskedForOutsideTheBox) {
  // The way down leads out of the box, through a corner; scales and faces that rounding hits.
  OptimizerProblem problem = problem_of({}, Eigen::VectorXd::Constant(6, 0.1), 1.0);
  problem.lower << -0.1, -0.7, -1.3, -0.2, -3.3, -0.3;
  problem.upper << 0.3, 0.1, 1.1, 0.7, 0.3, 0.9;
  problem.scale << 0.03, 0.01, 0.07, 0.01, 0.09, 0.011;
  bool outside = false;
  problem.cost = [&](const Eigen::VectorXd& x) {
    if ((x.array() < problem.lower.array()).any() || (x.array() > problem.upper.array()).any())
      outside = true;
    return x.dot(Eigen::VectorXd::LinSpaced(6, -3.0, 3.0));
  };
  OptimizerOptions options = options_of(GetParam(), 3000);
  const OptimizerResult result = optimize(problem, options);
  EXPECT_FALSE(outside);
  ASSERT_TRUE(result.best);
  Eigen::VectorXd corner = problem.lower;
  corner.head(3) = problem.upper.head(3);
  EXPECT_LT((*result.best - corner).cwiseQuotient(problem.scale).norm(), 0.1)
      << result.best->transpose();
}

TEST_P(Promise, CancellationStopsWithinOneEvaluation) {
  for (const int at : {0, 1, 5, 20, 61}) {
    int calls = 0;
    OptimizerProblem problem = bowl_problem();
    const Cost bowl = problem.cost;
    problem.cost = [&](const Eigen::VectorXd& x) {
      ++calls;
      return bowl(x);
    };
    OptimizerHooks hooks;
    hooks.cancelled = [&] { return calls >= at; };
    const OptimizerResult result = optimize(problem, restless(GetParam(), 10000), hooks);
    EXPECT_EQ(result.status, OptimizerStatus::kCancelled);
    EXPECT_EQ(calls, at);
    EXPECT_EQ(result.evaluations, at);
    EXPECT_EQ(result.best.has_value(), at > 0);
  }
}

TEST_P(Promise, ProgressTellsOfEachEvaluationAndNeverGetsWorse) {
  std::vector<int> counts;
  std::vector<double> bests;
  OptimizerHooks hooks;
  hooks.progress = [&](int evaluations, double best) {
    counts.push_back(evaluations);
    bests.push_back(best);
  };
  const OptimizerResult result = optimize(bowl_problem(), restless(GetParam(), 100), hooks);
  ASSERT_EQ(counts.size(), 100U);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    EXPECT_EQ(counts[i], static_cast<int>(i) + 1);
    EXPECT_LE(bests[i], bests[i > 0 ? i - 1 : 0]);
  }
  EXPECT_EQ(bests.back(), result.cost);
}

TEST_P(Promise, TheStartIsNeverMadeWorse) {
  // The start is a needle: nothing near it is as good.
  const Eigen::VectorXd start = point_at(10.0, 6, 2);
  const OptimizerResult result = optimize(
      problem_of([&](const Eigen::VectorXd& x) { return x == start ? -5.0 : x.norm(); }, start),
      options_of(GetParam(), 2000));
  ASSERT_TRUE(result.best);
  EXPECT_EQ(*result.best, start);
  EXPECT_EQ(result.cost, -5.0);
}

TEST_P(Promise, TheStartIsEvaluatedFirstAndOnce) {
  OptimizerProblem problem = bowl_problem();
  const Cost bowl = problem.cost;
  std::vector<Eigen::VectorXd> asked;
  problem.cost = [&](const Eigen::VectorXd& x) {
    asked.push_back(x);
    return bowl(x);
  };
  optimize(problem, restless(GetParam(), 60));
  EXPECT_EQ(asked.front(), problem.start);
  EXPECT_EQ(std::count(asked.begin(), asked.end(), problem.start), 1);
}

TEST_P(Promise, NothingButNaNFailsWithAReason) {
  for (const double value : {kNaN, kInfinity, -kInfinity}) {
    const OptimizerResult result =
        optimize(problem_of([=](const Eigen::VectorXd&) { return value; }, point_at(1.0, 6, 2)),
                 options_of(GetParam(), 2000));
    EXPECT_EQ(result.status, OptimizerStatus::kFailed);
    EXPECT_NE(result.reason.find("finite"), std::string::npos) << result.reason;
    EXPECT_FALSE(result.best);
    EXPECT_TRUE(std::isnan(result.cost));
    EXPECT_GE(result.evaluations, 1);
  }
}

TEST_P(Promise, RegionsWithoutACostAreAvoided) {
  // No cost on one side of a wall that cuts past the minimum, as where CT and ultrasound do not
  // overlap.
  const Eigen::VectorXd minimum = point_at(3.0, 6, 1);
  const Eigen::VectorXd wall = point_at(1.0, 6, 7);
  const Cost bowl = rotated_quadratic(minimum, 4.0);
  for (const double value : {kNaN, kInfinity, -kInfinity}) {
    int without = 0;
    const Cost cost = [&](const Eigen::VectorXd& x) {
      if (wall.dot(x - minimum) < -4.0) {
        ++without;
        return value;
      }
      return bowl(x);
    };
    Eigen::VectorXd start = minimum + point_at(10.0, 6, 2);
    if (wall.dot(start - minimum) < 0.0) start = 2.0 * minimum - start;
    start -= wall * (wall.dot(start - minimum) + 3.5);  // close to the wall
    const OptimizerResult result = optimize(problem_of(cost, start), options_of(GetParam(), 20000));
    EXPECT_GT(without, 0) << "the wall was not met: the test shows nothing";
    ASSERT_TRUE(result.best);
    EXPECT_LT((*result.best - minimum).norm(), 0.5) << result.reason << value;
  }
}

TEST(CmaEs, FindsItsWayFromAStartWithoutACost) {
  const Eigen::VectorXd minimum = point_at(3.0, 6, 1);
  const Cost bowl = rotated_quadratic(minimum, 4.0);
  const Eigen::VectorXd start = minimum + point_at(10.0, 6, 2);
  const OptimizerResult result = optimize(
      problem_of(
          [&](const Eigen::VectorXd& x) { return (x - start).norm() < 8.0 ? kNaN : bowl(x); },
          start),
      options_of(OptimizerMethod::kCmaEs));
  ASSERT_TRUE(result.best);
  EXPECT_LT((*result.best - minimum).norm(), 0.02);
}

TEST(LocalMethods, FailWithAReasonAtAStartWithoutACost) {
  const Eigen::VectorXd start = point_at(1.0, 6, 2);
  const OptimizerProblem problem =
      problem_of([&](const Eigen::VectorXd& x) { return x == start ? kNaN : 1.0; }, start);
  for (const OptimizerMethod method :
       {OptimizerMethod::kBobyqa, OptimizerMethod::kNelderMead, OptimizerMethod::kPraxis}) {
    const OptimizerResult result = optimize(problem, options_of(method));
    EXPECT_EQ(result.status, OptimizerStatus::kFailed);
    EXPECT_NE(result.reason.find("start"), std::string::npos) << result.reason;
    EXPECT_FALSE(result.best);
  }
}

TEST_P(Promise, WhatTheCostThrowsReachesTheCaller) {
  OptimizerProblem problem = bowl_problem();
  int calls = 0;
  problem.cost = [&](const Eigen::VectorXd& x) {
    if (++calls == 20) throw std::runtime_error("the volume is gone");
    return x.norm();
  };
  EXPECT_THROW(optimize(problem, restless(GetParam(), 1000)), std::runtime_error);
  EXPECT_EQ(calls, 20);
}

/// Rough, so that any difference in the path shows in the result.
OptimizerResult rough_run(OptimizerMethod method, std::uint32_t seed) {
  OptimizerOptions options = options_of(method, 700);
  options.seed = seed;
  const Eigen::VectorXd minimum = point_at(3.0, 6, 1);
  const Cost bowl = rotated_quadratic(minimum, 10.0);
  return optimize(problem_of([&](const Eigen::VectorXd& x) { return bowl(x) + rough(x); },
                             point_at(10.0, 6, 2)),
                  options);
}

void expect_same_bits(const OptimizerResult& a, const OptimizerResult& b) {
  EXPECT_EQ(*a.best, *b.best);
  EXPECT_EQ(a.cost, b.cost);
  EXPECT_EQ(a.evaluations, b.evaluations);
  EXPECT_EQ(a.status, b.status);
}

TEST(Optimizer, CmaEsAsksForAGenerationAtOnceAndFindsTheSame) {
  const Cost bowl = rotated_quadratic(point_at(3.0, 6, 1), 10.0);
  OptimizerProblem problem = problem_of(
      [&](const Eigen::VectorXd& x) { return bowl(x) + rough(x); }, point_at(10.0, 6, 2));
  for (const int budget : {5, 100, 700}) {
    const OptimizerOptions options = options_of(OptimizerMethod::kCmaEs, budget);
    problem.costs = nullptr;
    const OptimizerResult one_by_one = optimize(problem, options);
    std::size_t points = 0;
    problem.costs = [&](const std::vector<Eigen::VectorXd>& generation) {
      EXPECT_LE(generation.size(), 9U);
      points += generation.size();
      std::vector<double> costs;
      for (const Eigen::VectorXd& x : generation) costs.push_back(problem.cost(x));
      return costs;
    };
    expect_same_bits(one_by_one, optimize(problem, options));
    // All but the start.
    EXPECT_EQ(points + 1, static_cast<std::size_t>(one_by_one.evaluations)) << budget;
  }
}

TEST(Optimizer, AGenerationThatThrowsReachesTheCaller) {
  OptimizerProblem problem = bowl_problem();
  problem.costs = [](const std::vector<Eigen::VectorXd>&) -> std::vector<double> {
    throw std::runtime_error("the volume is gone");
  };
  EXPECT_THROW(optimize(problem, restless(OptimizerMethod::kCmaEs, 1000)), std::runtime_error);
}

TEST_P(Promise, TheSameSeedGivesTheSameBits) {
  const OptimizerResult first = rough_run(GetParam(), 5);
  rough_run(GetParam(), 6);  // must leave nothing behind
  expect_same_bits(first, rough_run(GetParam(), 5));
}

TEST(StochasticMethods, AnotherSeedTakesAnotherPath) {
  for (const OptimizerMethod method : {OptimizerMethod::kCmaEs, OptimizerMethod::kPraxis})
    EXPECT_NE(*rough_run(method, 5).best, *rough_run(method, 6).best) << method_name(method);
}

TEST(Threads, OptimizationsSideBySideGiveTheBitsOfOneAfterTheOther) {
  struct Run {
    OptimizerMethod method;
    std::uint32_t seed;
  };
  std::vector<Run> runs;
  for (std::uint32_t seed = 1; seed <= 8; ++seed)
    for (const OptimizerMethod method : all_methods()) runs.push_back({method, seed});
  std::vector<OptimizerResult> serial;
  for (const Run& run : runs) serial.push_back(rough_run(run.method, run.seed));

  std::vector<OptimizerResult> parallel(runs.size());
  std::atomic<std::size_t> next{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&] {
      for (std::size_t i = next++; i < runs.size(); i = next++)
        parallel[i] = rough_run(runs[i].method, runs[i].seed);
    });
  for (std::thread& thread : threads) thread.join();
  for (std::size_t i = 0; i < runs.size(); ++i) {
    SCOPED_TRACE(std::string(method_name(runs[i].method)) + " " + std::to_string(runs[i].seed));
    expect_same_bits(serial[i], parallel[i]);
  }
}

TEST(Results, StartAsFailed) {
  const OptimizerResult result;
  EXPECT_EQ(result.status, OptimizerStatus::kFailed);
  EXPECT_FALSE(result.best);
  EXPECT_FALSE(result.reason.empty());
}

TEST(Names, OfMethodsComeBack) {
  for (const OptimizerMethod method : all_methods())
    EXPECT_EQ(parse_method(method_name(method), "file"), method);
  expect_input_error([] { parse_method("simplex", "a.yaml"); }, {"a.yaml", "simplex", "cma_es"});
}

TEST(BadProblems, AreNamed) {
  const auto expect_refused = [](const std::function<void(OptimizerProblem&)>& spoil,
                                 const std::vector<std::string>& named) {
    OptimizerProblem problem = bowl_problem();
    spoil(problem);
    expect_input_error([&] { optimize(problem, OptimizerOptions()); }, named);
  };
  using Problem = OptimizerProblem;
  expect_refused([](Problem& p) { p.cost = nullptr; }, {"'cost'"});
  expect_refused([](Problem& p) { p.start.resize(1); }, {"'start'", "1 parameters"});
  expect_refused([](Problem& p) { p.start.resize(0); }, {"'start'", "0 parameters"});
  expect_refused([](Problem& p) { p.lower.resize(5); }, {"'lower'", "5", "6"});
  expect_refused([](Problem& p) { p.upper.resize(7); }, {"'upper'", "7", "6"});
  expect_refused([](Problem& p) { p.scale.resize(0); }, {"'scale'", "0", "6"});
  expect_refused([](Problem& p) { p.scale[3] = 0.0; }, {"'scale' of parameter 3", "> 0"});
  expect_refused([](Problem& p) { p.scale[3] = kNaN; }, {"'scale' of parameter 3", "nan"});
  expect_refused([](Problem& p) { p.start[2] = kNaN; }, {"'start' of parameter 2", "nan"});
  expect_refused([](Problem& p) { p.start[2] = 51.0; }, {"'start' of parameter 2", "51", "50"});
  expect_refused([](Problem& p) { p.lower[1] = p.upper[1]; }, {"'lower' of parameter 1", "50"});
  expect_refused([](Problem& p) { p.upper[1] = kNaN; }, {"parameter 1", "nan"});
  expect_refused([](Problem& p) { p.upper[1] = kInfinity; }, {"parameter 1", "-50", "inf", "both"});
  expect_refused(
      [](Problem& p) {
        p.lower[4] = p.start[4] - 0.01;
        p.upper[4] = p.start[4] + 0.01;
      },
      {"box", "0.02 units", "0.01"});
}

TEST(BadOptions, AreNamed) {
  const auto expect_refused = [](const std::function<void(OptimizerOptions&)>& spoil,
                                 const std::vector<std::string>& named) {
    OptimizerOptions options;
    spoil(options);
    expect_input_error([&] { optimize(bowl_problem(), options); }, named);
  };
  using Options = OptimizerOptions;
  expect_refused([](Options& o) { o.max_evaluations = -1; }, {"'max_evaluations'", "-1"});
  expect_refused([](Options& o) { o.initial_step = 0.0; }, {"'initial_step'", "0"});
  expect_refused([](Options& o) { o.initial_step = kInfinity; }, {"'initial_step'", "inf"});
  expect_refused([](Options& o) { o.step_tolerance = 0.0; }, {"'step_tolerance'", "> 0"});
  expect_refused([](Options& o) { o.step_tolerance = 5.0; }, {"'step_tolerance'", "5"});
  expect_refused([](Options& o) { o.step_tolerance = kNaN; }, {"'step_tolerance'", "nan"});
  expect_refused([](Options& o) { o.cost_tolerance = -1e-3; }, {"'cost_tolerance'", "-0.001"});
  expect_refused([](Options& o) { o.cost_tolerance = kNaN; }, {"'cost_tolerance'", "nan"});
  expect_refused([](Options& o) { o.population = 4; }, {"'population'", "4", "5"});
  expect_refused([](Options& o) { o.population = -9; }, {"'population'", "-9"});
}

}  // namespace
}  // namespace usct::test
