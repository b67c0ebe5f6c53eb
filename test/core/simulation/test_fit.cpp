#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>

#include "core/geometry/random_geometry.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/simulation/simulation.h"

namespace usct::test {
namespace {

/// Components of 10 x 8 x 3 samples with p and r that vary independently; the last three samples of
/// line 0 are occluded, line 1 lies outside the CT.
SimulatedComponents some_components() {
  SimulatedComponents c;
  c.samples = 10;
  c.lines = 8;
  c.frames = 3;
  for (int i = 0; i < 240; ++i) {
    c.mapped_ct.push_back(static_cast<float>(100 + (37 * i) % 101));
    c.reflection.push_back(static_cast<float>((53 * i) % 71) / 71.0F);
    const int sample = i % 10;
    const int line = (i / 10) % 8;
    c.flags.push_back(line == 0 && sample >= 7 ? int{kOccluded} : line == 1 ? int{kOutsideCt} : 0);
  }
  return c;
}

constexpr double kPsi = 33.0;

std::vector<float> combination(const SimulatedComponents& c, const SimulationWeights& w) {
  std::vector<float> us;
  for (std::size_t i = 0; i < c.count(); ++i)
    us.push_back(static_cast<float>((c.flags[i] & kOccluded) != 0
                                        ? kPsi + (i % 2 == 0 ? 4.0 : -4.0)
                                        : w.mapped_ct * c.mapped_ct[i] +
                                              w.reflection * c.reflection[i] + w.bias));
  return us;
}

RC_GTEST_PROP(SimulationFit, RecoversTheWeightsThatMadeTheUltrasound, ()) {
  const SimulatedComponents c = some_components();
  const SimulationWeights truth{uniform(-2.0, 2.0), uniform(-200.0, 200.0), uniform(-100.0, 100.0)};
  const SimulatedUltrasound fit = fit_to_ultrasound(c, combination(c, truth), {}, {});
  RC_ASSERT(fit.status == FitStatus::kFitted);
  RC_ASSERT(std::abs(fit.weights.mapped_ct - truth.mapped_ct) < 1e-5);
  RC_ASSERT(std::abs(fit.weights.reflection - truth.reflection) < 1e-3);
  RC_ASSERT(std::abs(fit.weights.bias - truth.bias) < 1e-3);
}

TEST(SimulationFit, OccludedSamplesAreTheMeanOfTheUltrasoundThereAndCountInLc2) {
  const SimulatedComponents c = some_components();
  const std::vector<float> us = combination(c, {1.0, 50.0, 0.0});
  const SimulatedUltrasound fit = fit_to_ultrasound(c, us, {}, {});
  EXPECT_EQ(fit.occluded, 9U);
  EXPECT_EQ(fit.used, 240U);
  EXPECT_NEAR(fit.occluded_mean, (5 * (kPsi - 4.0) + 4 * (kPsi + 4.0)) / 9.0, 1.0);
  double sum = 0.0;
  double squares = 0.0;
  double psi = 0.0;
  for (std::size_t i = 0; i < us.size(); ++i) {
    sum += us[i];
    if ((c.flags[i] & kOccluded) != 0) psi += us[i] / 9.0;
  }
  for (const float u : us) squares += (u - sum / 240.0) * (u - sum / 240.0);
  double residual = 0.0;
  for (std::size_t i = 0; i < us.size(); ++i)
    if ((c.flags[i] & kOccluded) != 0) residual += (us[i] - psi) * (us[i] - psi);
  EXPECT_NEAR(fit.occluded_mean, psi, 1e-5);
  EXPECT_NEAR(fit.lc2, 1.0 - residual / squares, 1e-6);
  EXPECT_NEAR(fit.brightness[7], psi, 1e-4);
}

RC_GTEST_PROP(SimulationFit, GainAndOffsetOfTheUltrasoundScaleTheSimulationWithIt, ()) {
  const SimulatedComponents c = some_components();
  std::vector<float> us;
  for (std::size_t i = 0; i < c.count(); ++i) us.push_back(static_cast<float>(integer(0, 256)));
  const double gain = uniform(0.1, 5.0);
  const double offset = uniform(-50.0, 50.0);
  std::vector<float> changed;
  for (const float u : us) changed.push_back(static_cast<float>(gain * u + offset));
  const SimulatedUltrasound a = fit_to_ultrasound(c, us, {}, {});
  const SimulatedUltrasound b = fit_to_ultrasound(c, changed, {}, {});
  RC_ASSERT(a.has_fit() && b.has_fit());
  RC_ASSERT(std::abs(a.lc2 - b.lc2) < 1e-5);
  for (std::size_t i = 0; i < us.size(); ++i)
    RC_ASSERT(std::abs(gain * a.brightness[i] + offset - b.brightness[i]) < 1e-3 * (1.0 + gain));
}

TEST(SimulationFit, ExcludedSamplesDoNotCountWhateverTheyHold) {
  const SimulatedComponents c = some_components();
  const SimulationWeights truth{0.7, -30.0, 12.0};
  std::vector<float> us = combination(c, truth);
  std::vector<std::uint8_t> excluded(us.size());
  for (std::size_t i = 100; i < 160; ++i) {
    us[i] = std::numeric_limits<float>::quiet_NaN();
    excluded[i] = 16;
  }
  const SimulatedUltrasound fit = fit_to_ultrasound(c, us, excluded, {});
  EXPECT_EQ(fit.used, 180U);
  EXPECT_NEAR(fit.weights.mapped_ct, 0.7, 1e-5);
  EXPECT_THROW(fit_to_ultrasound(c, us, {}, {}), InputError);
}

TEST(SimulationFit, BackgroundCountsUnlessLeftOut) {
  const SimulatedComponents c = some_components();
  std::vector<float> us = combination(c, {1.0, 0.0, 0.0});
  for (std::size_t i = 0; i < us.size(); ++i)
    if (c.flags[i] == kOutsideCt) us[i] = 250.0F;
  FitOptions options;
  EXPECT_EQ(fit_to_ultrasound(c, us, {}, options).used, 240U);
  EXPECT_GT(std::abs(fit_to_ultrasound(c, us, {}, options).weights.mapped_ct - 1.0), 1e-3);
  options.use_background = false;
  const SimulatedUltrasound fit = fit_to_ultrasound(c, us, {}, options);
  EXPECT_EQ(fit.used, 210U);
  EXPECT_NEAR(fit.weights.mapped_ct, 1.0, 1e-6);
  EXPECT_NEAR(fit.overlap, 210.0 / 240.0, 1e-12);
}

TEST(SimulationFit, FixedWeightsAreUsedAsGiven) {
  const SimulatedComponents c = some_components();
  const std::vector<float> us = combination(c, {1.0, 50.0, 0.0});
  FitOptions options;
  options.fixed_weights = SimulationWeights{2.0, 3.0, 4.0};
  const SimulatedUltrasound fit = fit_to_ultrasound(c, us, {}, options);
  EXPECT_EQ(fit.status, FitStatus::kFixedWeights);
  EXPECT_FLOAT_EQ(fit.brightness[0], 2.0F * c.mapped_ct[0] + 3.0F * c.reflection[0] + 4.0F);
  EXPECT_LT(fit.lc2, fit_to_ultrasound(c, us, {}, {}).lc2);
}

TEST(SimulationFit, CollinearImagesGetFiniteWeightsThatFitAsWell) {
  SimulatedComponents c = some_components();
  for (std::size_t i = 0; i < c.count(); ++i) c.reflection[i] = c.mapped_ct[i] / 256.0F;
  const std::vector<float> us = combination(c, {1.5, 0.0, 2.0});
  const SimulatedUltrasound fit = fit_to_ultrasound(c, us, {}, {});
  EXPECT_EQ(fit.status, FitStatus::kFitted);
  EXPECT_NEAR(fit.weights.mapped_ct + fit.weights.reflection / 256.0, 1.5, 1e-6);
  EXPECT_NEAR(fit.brightness[0], us[0], 1e-3);
}

TEST(SimulationFit, AConstantImageGetsNoWeight) {
  SimulatedComponents c = some_components();
  c.reflection.assign(c.count(), 0.25F);
  const SimulatedUltrasound fit = fit_to_ultrasound(c, combination(c, {1.5, 8.0, 2.0}), {}, {});
  EXPECT_EQ(fit.status, FitStatus::kFitted);
  EXPECT_EQ(fit.weights.reflection, 0.0);
  EXPECT_NEAR(fit.weights.mapped_ct, 1.5, 1e-6);
  EXPECT_NEAR(fit.weights.bias, 4.0, 1e-3);
}

void expect_no_fit(const SimulatedUltrasound& fit, FitStatus status) {
  EXPECT_EQ(fit.status, status) << to_string(fit.status);
  EXPECT_FALSE(fit.has_fit());
  EXPECT_FALSE(fit.message.empty());
  EXPECT_TRUE(fit.brightness.empty());
  EXPECT_EQ(fit.lc2, 0.0);
  for (const double value : {fit.weights.mapped_ct, fit.weights.reflection, fit.weights.bias})
    EXPECT_EQ(value, 0.0);
}

TEST(SimulationFit, WhatCannotBeFittedIsAStatusWithAReason) {
  const SimulatedComponents c = some_components();
  const std::vector<float> us = combination(c, {1.0, 50.0, 0.0});
  const std::vector<std::uint8_t> all(us.size(), 1);
  expect_no_fit(fit_to_ultrasound(c, us, all, {}), FitStatus::kNoUsableUltrasound);
  expect_no_fit(fit_to_ultrasound(c, std::vector<float>(us.size(), 80.1F), {}, {}),
                FitStatus::kConstantUltrasound);
  SimulatedComponents altered = c;
  altered.flags.assign(c.count(), kOccluded);
  expect_no_fit(fit_to_ultrasound(altered, us, {}, {}), FitStatus::kAllOccluded);
  altered.flags.assign(c.count(), kOutsideCt);
  expect_no_fit(fit_to_ultrasound(altered, us, {}, {}), FitStatus::kNoOverlap);
  FitOptions options;
  options.min_overlap = 0.0;
  expect_no_fit(fit_to_ultrasound(altered, us, {}, options), FitStatus::kNoOverlap);
  options.min_overlap = 0.9;  // 7 of 8 lines
  expect_no_fit(fit_to_ultrasound(c, us, {}, options), FitStatus::kNoOverlap);
  altered = c;
  altered.mapped_ct.assign(c.count(), 17.3F);
  altered.reflection.assign(c.count(), 0.0F);
  expect_no_fit(fit_to_ultrasound(altered, us, {}, {}), FitStatus::kNoContrast);
  options = {};
  options.fixed_weights = SimulationWeights{1.0, 1.0, 0.0};
  expect_no_fit(fit_to_ultrasound(c, std::vector<float>(us.size(), 5.0F), {}, options),
                FitStatus::kConstantUltrasound);
}

TEST(SimulationFit, RefusesSizesAndOptionsThatAreWrong) {
  const SimulatedComponents c = some_components();
  const std::vector<float> us(c.count(), 1.0F);
  EXPECT_THROW(fit_to_ultrasound(c, {1.0F}, {}, {}), InputError);
  EXPECT_THROW(fit_to_ultrasound(c, us, {1}, {}), InputError);
  EXPECT_THROW(fit_to_ultrasound({}, {}, {}, {}), InputError);
  FitOptions options;
  options.min_overlap = 1.5;
  EXPECT_THROW(fit_to_ultrasound(c, us, {}, options), InputError);
  options = {};
  options.fixed_weights = SimulationWeights{std::nan(""), 0.0, 0.0};
  EXPECT_THROW(fit_to_ultrasound(c, us, {}, options), InputError);
}

}  // namespace
}  // namespace usct::test
