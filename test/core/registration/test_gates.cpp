#include <gtest/gtest.h>

#include <limits>

#include "core/io/expect_input_error.h"
#include "core/registration/registration_cases.h"
#include "nan.h"

namespace usct::test {
namespace {

/// Measures exactly at the limits.
Measures passing(const GateLimits& limits) {
  Measures measures;
  measures.overlap = limits.min_overlap;
  measures.wrong_probability = limits.max_wrong_probability;
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
  EXPECT_TRUE(fails([](Measures& m) { *m.wrong_probability += 1e-9; }));
  EXPECT_FALSE(fails([](Measures& m) { *m.overlap = 1.0; }));
  EXPECT_FALSE(fails([](Measures& m) { *m.wrong_probability = 0.0; }));
}

TEST(Gates, AValueNextToItsLimitIsTold) {
  Measures measures = passing({});
  measures.wrong_probability = 0.3000004;
  GateLimits limits;
  limits.max_wrong_probability = 0.3;
  const std::optional<GateFailure> failure = judge(measures, limits);
  ASSERT_TRUE(failure);
  EXPECT_NE(failure->message.find("is 0.3000004, must be <= 0.3"), std::string::npos)
      << failure->message;
}

TEST(Gates, AGateIsSwitchedOffByName) {
  GateLimits limits;
  limits.max_wrong_probability.reset();
  Measures measures = passing({});
  measures.wrong_probability.reset();
  EXPECT_FALSE(judge(measures, limits));
  measures.overlap.reset();
  EXPECT_TRUE(judge(measures, limits));
}

/// A limit beyond what its measure can be would switch its gate off, or refuse every pose.
TEST(Gates, ALimitOutsideOfItsMeasureIsRefused) {
  for (const double limit : {-0.1, 1.1, kNan}) {
    GateLimits limits;
    limits.min_overlap = limit;
    expect_input_error([&] { limits.validate("gates"); }, {"gates", "'min_overlap'", "[0, 1]"});
    limits = {};
    limits.max_wrong_probability = limit;
    expect_input_error([&] { limits.validate("gates"); },
                       {"gates", "'max_wrong_probability'", "[0, 1]"});
  }
}

TEST(Gates, WithNoneOfThemNothingIsRefused) {
  EXPECT_FALSE(judge(Measures{}, GateLimits::none()));
  Measures measures;
  measures.overlap = 0.0;
  measures.wrong_probability = 1.0;
  EXPECT_FALSE(judge(measures, GateLimits::none()));
}

TEST(Measures, ComeBackFromTheirNames) {
  Measures measures = passing({});
  measures.sweep_error = -0.01;
  EXPECT_EQ(by_name(measures_from(by_name(measures), "test")), by_name(measures));
  EXPECT_EQ(by_name(measures).size(), 3U);
  expect_input_error(
      [] {
        measures_from({{"scatter_mm", 1.0}}, "file.json");
      },
      {"file.json", "scatter_mm"});
}

/// Expects a refusal whose first candidate is the right pose all the same.
void expect_refused(const RegistrationResult& result, RegistrationStatus status,
                    const std::vector<std::string>& named) {
  EXPECT_EQ(result.status, status) << result.message;
  EXPECT_FALSE(result.T_us_ct);
  for (const std::string& part : named)
    EXPECT_NE(result.message.find(part), std::string::npos) << part << "\n" << result.message;
  ASSERT_FALSE(result.candidates.empty());
  EXPECT_LT(agar_case().error_mm(result.candidates.front().T_us_ct), 1.0);
}

RegistrationResult with_options(const std::string& changes) {
  return registered(agar_case(), nearby(agar_case()), quick_options(changes));
}

TEST(Gates, AnImpossibleLimitRefusesARightPoseAndSaysWhy) {
  const RegistrationResult result =
      with_options("confidence: {gates: {max_wrong_probability: 0}}\n");
  char value[32];
  std::snprintf(value, sizeof(value), "%.3g", result.measures.wrong_probability.value());
  expect_refused(result, RegistrationStatus::kLowConfidence,
                 {"wrong_probability is " + std::string(value) + ", must be <= 0"});
}

TEST(Gates, Overlap) {
  const RegistrationResult result = with_options("confidence: {gates: {min_overlap: 1}}\n");
  ASSERT_LT(result.overlap, 1.0);
  expect_refused(result, RegistrationStatus::kNoOverlap, {"overlap is ", "must be >= 1"});
}

/// A similarity that has no parts cannot be compared patch by patch: no pose could be accepted.
TEST(Gates, OptionsThatGiveNoEvidenceAreRefusedUnlessTheGateIsOff) {
  const std::string no_parts =
      "similarity: {kind: ncc, patches: {depth_mm: 6, lateral_mm: 8, elevation_mm: 8, "
      "least_share: 0.5, samples: all}}, parts: {optimizer: {method: bobyqa}}";
  expect_input_error([&] { with_options("confidence: {evidence: own, " + no_parts + "}\n"); },
                     {"'confidence.similarity' is ncc", "no evidence"});
  const RegistrationResult result =
      with_options("confidence: {gates: {max_wrong_probability: none}, " + no_parts + "}\n");
  EXPECT_EQ(result.status, RegistrationStatus::kRegistered) << result.message;
}

/// Nothing is spent on evidence that no gate asks for.
TEST(Gates, WithoutTheGateNoEvidenceIsGathered) {
  const RegistrationResult judged = with_options("");
  const RegistrationResult result =
      with_options("confidence: {gates: {max_wrong_probability: none}}\n");
  ASSERT_EQ(result.status, RegistrationStatus::kRegistered) << result.message;
  EXPECT_EQ(result.candidates.front().T_us_ct.matrix(), judged.candidates.front().T_us_ct.matrix());
  EXPECT_LT(result.evaluations, judged.evaluations);
  EXPECT_FALSE(result.covariance);
  EXPECT_FALSE(result.measures.mirror_ratio);
  EXPECT_TRUE(result.measures.overlap);
  EXPECT_TRUE(result.measures.displacement_mm);
}

}  // namespace
}  // namespace usct::test
