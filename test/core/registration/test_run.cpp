#include <gtest/gtest.h>

#include <chrono>
#include <stdexcept>
#include <thread>

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

}  // namespace
}  // namespace usct::test
