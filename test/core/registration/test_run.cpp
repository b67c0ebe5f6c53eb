#include <gtest/gtest.h>

#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

#include "registration/run.h"

namespace usct::test {
namespace {

void pause() { std::this_thread::sleep_for(std::chrono::milliseconds(20)); }

double sum_of(const std::map<std::string, double>& seconds) {
  double sum = 0.0;
  for (const auto& [step, taken] : seconds) sum += taken;
  return sum;
}

/// Whoever adds the steps up must get the time of the registration: a step within another one
/// counts once.
TEST(TimesOfSteps, AreTogetherNoLongerThanTheWhole) {
  const RegistrationHooks hooks;
  registration::Run run(hooks);
  const auto begin = std::chrono::steady_clock::now();
  run.timed("outer", [&] {
    run.timed("inner", [&] {
      run.timed("innermost", pause);
      pause();
    });
    run.timed("inner", pause);
  });
  run.timed("outer", pause);
  const std::chrono::duration<double> whole = std::chrono::steady_clock::now() - begin;
  EXPECT_EQ(run.seconds().size(), 3U);
  EXPECT_LE(sum_of(run.seconds()), whole.count());
  EXPECT_GE(run.seconds().at("inner"), 0.04);
  EXPECT_GE(run.seconds().at("outer"), 0.02);
}

TEST(TimesOfSteps, AStepThatThrowsIsCountedAndEnds) {
  const RegistrationHooks hooks;
  registration::Run run(hooks);
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_THROW(run.timed("outer",
                         [&] {
                           run.timed("inner", [] {
                             pause();
                             throw std::runtime_error("refused");
                           });
                         }),
               std::runtime_error);
  run.timed("next", pause);
  const std::chrono::duration<double> whole = std::chrono::steady_clock::now() - begin;
  EXPECT_GE(run.seconds().at("inner"), 0.02);
  EXPECT_GE(run.seconds().at("next"), 0.02);
  EXPECT_LE(sum_of(run.seconds()), whole.count());
}

/// A step reports fractions of its own, wherever the step stands in the registration.
TEST(Progress, OfAPartIsAFractionOfTheWhole) {
  std::vector<double> reported;
  RegistrationHooks hooks;
  hooks.progress = [&](double fraction) { reported.push_back(fraction); };
  registration::Run run(hooks);
  run.report(0.1);
  {
    const registration::Run::Part half(run, 0.5, 1.0);
    run.report(0.0);
    {
      const registration::Run::Part quarter(run, 0.0, 0.5);
      run.report(0.5);
      run.report(1.0);
    }
    run.report(0.4);  // less than it was
    run.report(0.75);
  }
  run.report(0.9);
  ASSERT_EQ(reported.size(), 6U);
  const double expected[] = {0.1, 0.5, 0.625, 0.75, 0.875, 0.9};
  for (std::size_t i = 0; i < reported.size(); ++i) EXPECT_NEAR(reported[i], expected[i], 1e-12);
}

TEST(Progress, AStepThatThrowsEndsItsPart) {
  double last = 0.0;
  RegistrationHooks hooks;
  hooks.progress = [&](double fraction) { last = fraction; };
  registration::Run run(hooks);
  EXPECT_THROW(
      {
        const registration::Run::Part part(run, 0.0, 0.5);
        throw std::runtime_error("refused");
      },
      std::runtime_error);
  run.report(0.8);
  EXPECT_NEAR(last, 0.8, 1e-12);
}

}  // namespace
}  // namespace usct::test
