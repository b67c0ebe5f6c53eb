#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/io/expect_input_error.h"
#include "core/registration/registration_cases.h"

namespace usct::test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Measures exactly at the limits.
Measures passing(const GateLimits& limits) {
  Measures measures;
  measures.overlap = limits.min_overlap;
  measures.significance = limits.min_significance;
  measures.margin = limits.min_margin;
  measures.disagreement_mm = limits.max_disagreement_mm;
  measures.displacement_mm = limits.max_displacement_mm;
  measures.scatter_mm = limits.max_scatter_mm;
  return measures;
}

TEST(Gates, LimitsThemselvesPass) { EXPECT_FALSE(judge(passing({}), {})); }

TEST(Gates, AMeasureThatIsAbsentOrNoNumberFailsItsGateAndNoOther) {
  const GateLimits limits;
  for (const MeasureField& field : measure_fields()) {
    const bool is_judged = (passing(limits).*field.value).has_value();
    for (const std::optional<double>& value : {std::optional<double>(), std::optional(kNan)}) {
      Measures measures = passing(limits);
      measures.*field.value = value;
      const std::optional<GateFailure> failure = judge(measures, limits);
      ASSERT_EQ(failure.has_value(), is_judged) << field.name;
      if (!failure) continue;
      EXPECT_NE(failure->message.find(field.name), std::string::npos) << failure->message;
      EXPECT_NE(failure->message.find(value ? "is nan" : "was not measured"), std::string::npos)
          << failure->message;
      EXPECT_EQ(failure->no_overlap, std::string(field.name) == "overlap");
    }
  }
}

TEST(Gates, EachHasItsLimitOnItsSide) {
  const GateLimits limits;
  const auto fails = [&](const auto& change) {
    Measures measures = passing(limits);
    change(measures);
    return judge(measures, limits).has_value();
  };
  EXPECT_TRUE(fails([](Measures& m) { *m.overlap -= 1e-9; }));
  EXPECT_TRUE(fails([](Measures& m) { *m.significance -= 1e-9; }));
  EXPECT_TRUE(fails([](Measures& m) { *m.margin -= 1e-9; }));
  EXPECT_TRUE(fails([](Measures& m) { *m.disagreement_mm += 1e-9; }));
  EXPECT_TRUE(fails([](Measures& m) { *m.displacement_mm += 1e-9; }));
  EXPECT_TRUE(fails([](Measures& m) { *m.scatter_mm += 1e-9; }));
  EXPECT_FALSE(fails([](Measures& m) { *m.overlap = 1.0; }));
  EXPECT_FALSE(fails([](Measures& m) { *m.significance = 99.0; }));
  EXPECT_FALSE(fails([](Measures& m) { *m.margin = 1.0; }));
  EXPECT_FALSE(fails([](Measures& m) { m.disagreement_mm = m.displacement_mm = 0.0; }));
  EXPECT_FALSE(fails([](Measures& m) { m.scatter_mm = 0.0; }));
}

TEST(Gates, AGateIsSwitchedOffByName) {
  GateLimits limits;
  limits.max_scatter_mm.reset();
  Measures measures = passing(GateLimits{});
  measures.scatter_mm.reset();
  EXPECT_FALSE(judge(measures, limits));
  measures.margin.reset();
  EXPECT_TRUE(judge(measures, limits));
}

TEST(Measures, ComeBackFromTheirNames) {
  Measures measures = passing({});
  measures.margin.reset();
  measures.sweep_error = -0.01;
  EXPECT_EQ(by_name(measures_from(by_name(measures), "test")), by_name(measures));
  EXPECT_EQ(by_name(measures).size(), 6U);
  expect_input_error(
      [] {
        measures_from({{"skatter_mm", 1.0}}, "file.json");
      },
      {"file.json", "skatter_mm"});
}

void expect_refused(const RegistrationResult& result, RegistrationStatus status,
                    const std::string& named) {
  EXPECT_EQ(result.status, status) << result.message;
  EXPECT_FALSE(result.T_us_ct);
  EXPECT_NE(result.message.find(named), std::string::npos) << result.message;
}

/// A similarity that has no parts measures no scatter.
TEST(Gates, ARegistrationWithoutScatterIsRefusedUnlessTheGateIsOff) {
  const std::string scatter =
      "scatter: {similarity: {kind: ncc, patches: {depth_mm: 6, lateral_mm: 8, elevation_mm: 8, "
      "least_share: 0.5, samples: all}}}";
  expect_refused(registered(agar_case(), nearby(agar_case()),
                            quick_options("confidence: {" + scatter + "}\n")),
                 RegistrationStatus::kLowConfidence, "scatter_mm was not measured");
  const RegistrationResult result =
      registered(agar_case(), nearby(agar_case()),
                 quick_options("confidence: {gates: {max_scatter_mm: none}, " + scatter + "}\n"));
  EXPECT_EQ(result.status, RegistrationStatus::kRegistered) << result.message;
}

/// Registers with one gate that no pose passes.
void expect_gate(const std::string& option, const std::string& impossible,
                 const std::string& measure, const std::string& limit) {
  const RegistrationResult result =
      registered(agar_case(), nearby(agar_case()),
                 quick_options("confidence: {gates: {" + option + ": " + impossible + "}}\n"));
  expect_refused(result, RegistrationStatus::kLowConfidence, measure + " is ");
  char value[32];
  std::snprintf(value, sizeof(value), "%.3g", by_name(result.measures).at(measure));
  expect_refused(result, RegistrationStatus::kLowConfidence,
                 measure + " is " + value + ", must be " + limit);
  ASSERT_FALSE(result.candidates.empty());
  EXPECT_LT(agar_case().error_mm(result.candidates.front().T_us_ct), 1.0);
}

TEST(Gates, EachRefusesAndSaysWhy) {
  expect_gate("min_significance", "1e6", "significance", ">= 1e+06");
  expect_gate("max_disagreement_mm", "1e-6", "disagreement_mm", "<= 1e-06");
  expect_gate("max_displacement_mm", "2.5", "displacement_mm", "<= 2.5");
  expect_gate("max_scatter_mm", "0.01", "scatter_mm", "<= 0.01");
}

TEST(Gates, Overlap) {
  const RegistrationResult result = registered(
      agar_case(), nearby(agar_case()), quick_options("confidence: {gates: {min_overlap: 1}}\n"));
  ASSERT_LT(result.overlap, 1.0);
  expect_refused(result, RegistrationStatus::kNoOverlap, "overlap is ");
  expect_refused(result, RegistrationStatus::kNoOverlap, "must be >= 1");
  EXPECT_FALSE(result.candidates.empty());
}

/// Registers with levels that keep many optima.
RegistrationResult with_rivals(const std::string& gates) {
  RegistrationOptions options = quick_options("confidence: {gates: {" + gates + "}}\n");
  options.search.levels[0].optimised = 12;
  options.search.levels[0].kept = 12;
  options.search.levels[1].optimised = 12;
  return registered(agar_case(), nearby(agar_case()), options);
}

/// Registers with a margin that fails if any other optimum is above the background.
RegistrationResult with_margin_of_one(const std::string& max_scatter_mm) {
  return with_rivals("min_margin: 1, max_scatter_mm: " + max_scatter_mm);
}

TEST(Gates, MarginAgainstOptimaElsewhere) {
  const RegistrationResult result = with_margin_of_one("none");
  expect_refused(result, RegistrationStatus::kLowConfidence, "margin is ");
  ASSERT_GE(result.candidates.size(), 2U);
  for (std::size_t i = 1; i < result.candidates.size(); ++i)
    EXPECT_LE(result.candidates[i].similarity, result.candidates[i - 1].similarity);
}

TEST(Gates, WhatScattersTooMuchIsNoRival) {
  const double limit_mm = *GateLimits().max_scatter_mm;
  const RegistrationResult result = with_margin_of_one(std::to_string(limit_mm));
  EXPECT_EQ(result.status, RegistrationStatus::kRegistered) << result.message;
  EXPECT_LT(result.measures.scatter_mm.value(), limit_mm);
  EXPECT_EQ(result.measures.margin.value(), 1.0);
}

/// The best optimum is the truth, which lies beyond the limit.
TEST(Gates, WhatIsTooFarAndScattersGivesWayToTheNextBest) {
  const RegistrationResult all = with_rivals("max_scatter_mm: 0.01");  // no optimum passes
  ASSERT_GE(all.candidates.size(), 2U);
  ASSERT_LT(agar_case().error_mm(all.candidates.front().T_us_ct), 1.0);
  const RegistrationResult other = with_rivals("max_scatter_mm: 0.01, max_displacement_mm: 6");
  EXPECT_EQ(other.status, RegistrationStatus::kLowConfidence);
  EXPECT_TRUE(std::any_of(all.candidates.begin() + 1, all.candidates.end(),
                          [&](const auto& next) { return next.similarity == other.similarity; }));
  // An optimum that does not scatter is kept, and is refused for its distance.
  const RegistrationResult far = with_rivals("max_scatter_mm: 0.5, max_displacement_mm: 6");
  expect_refused(far, RegistrationStatus::kLowConfidence, "displacement_mm is ");
  EXPECT_EQ(far.similarity, all.similarity);
}

}  // namespace
}  // namespace usct::test
