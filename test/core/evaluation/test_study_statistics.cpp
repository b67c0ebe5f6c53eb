#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

#include "core/evaluation/small_study.h"
#include "core/geometry/random_geometry.h"
#include "core/io/expect_input_error.h"
#include "us_ct_registration/evaluation/study_statistics.h"

namespace usct::test {
namespace {

TEST(Summary, IsThatOfAHandComputedExample) {
  const Summary summary = summary_of({4.0, 1.0, 2.0, 5.0});
  EXPECT_EQ(summary.count, 4U);
  EXPECT_DOUBLE_EQ(summary.mean, 3.0);
  EXPECT_DOUBLE_EQ(summary.median, 3.0);
  EXPECT_DOUBLE_EQ(summary.deviation, std::sqrt(10.0 / 3.0));
  EXPECT_DOUBLE_EQ(summary.max, 5.0);
  EXPECT_DOUBLE_EQ(summary_of({7.0, 1.0, 2.0}).median, 2.0);
}

TEST(Summary, OfTooFewIsNotANumber) {
  EXPECT_TRUE(std::isnan(summary_of({}).mean));
  EXPECT_DOUBLE_EQ(summary_of({3.0}).mean, 3.0);
  EXPECT_TRUE(std::isnan(summary_of({3.0}).deviation));
}

// Without ties, the value is 1 - 6 sum d^2 / (n (n^2 - 1)); Spearman's own IQ example gives
// -29/165.
TEST(Spearman, IsThatOfKnownExamples) {
  EXPECT_NEAR(spearman_correlation({106, 100, 86, 101, 99, 103, 97, 113, 112, 110},
                                   {7, 27, 2, 50, 28, 29, 20, 12, 6, 17}),
              -29.0 / 165.0, 1e-12);
  EXPECT_NEAR(spearman_correlation({1, 2, 3}, {10, 1000, 1e9}), 1.0, 1e-12);
  EXPECT_NEAR(spearman_correlation({1, 2, 3}, {5, 4, -7}), -1.0, 1e-12);
  // Ranks 1.5 1.5 3 4 and 1 2 3.5 3.5: deviations -1 -1 .5 1.5 and -1.5 -.5 1 1.
  EXPECT_NEAR(spearman_correlation({2, 2, 5, 9}, {0, 1, 8, 8}), 4.0 / 4.5, 1e-12);
  EXPECT_TRUE(std::isnan(spearman_correlation({1}, {2})));
  EXPECT_TRUE(std::isnan(spearman_correlation({1, 2, 3}, {4, 4, 4})));
  expect_input_error([] { spearman_correlation({1, 2}, {1}); }, {"2 and 1"});
}

RC_GTEST_PROP(Spearman, DependsOnOrderAlone, ()) {
  std::vector<double> a;
  std::vector<double> b;
  std::vector<double> exp_b;
  for (int i = integer(2, 30); i > 0; --i) {
    a.push_back(integer(0, 8));
    b.push_back(integer(0, 8));
    exp_b.push_back(std::exp(b.back()));
  }
  const double r = spearman_correlation(a, b);
  if (std::isnan(r)) return;
  RC_ASSERT(std::abs(r) <= 1.0 + 1e-12);
  RC_ASSERT(std::abs(r - spearman_correlation(b, a)) < 1e-12);
  RC_ASSERT(std::abs(r - spearman_correlation(a, exp_b)) < 1e-12);
}

TEST(Bins, BelongToTheirRangeWithBothEnds) {
  const std::vector<double> edges_mm{5.0, 10.0, 20.0};
  EXPECT_EQ(bin_of(5.0, edges_mm), 0U);
  EXPECT_EQ(bin_of(5.0 - 4e-13, edges_mm), 0U);
  EXPECT_EQ(bin_of(10.0, edges_mm), 1U);
  EXPECT_EQ(bin_of(20.0 + 3e-13, edges_mm), 1U);
  EXPECT_EQ(bin_of(4.9, edges_mm), std::nullopt);
  EXPECT_EQ(bin_of(20.1, edges_mm), std::nullopt);
  EXPECT_EQ(bin_of(std::nan(""), edges_mm), std::nullopt);
  // All starts at one distance, which is computed from their poses.
  EXPECT_EQ(bin_of(10.0 + 3e-13, {10.0, 10.0}), 0U);
  EXPECT_EQ(bin_of(10.0, {}), std::nullopt);
}

TEST(GroupStatistics, AreThoseOfAHandComputedExample) {
  const std::vector<StudyRun> runs{
      run_with_error("b", 1.0, 3.0, 2.0),    run_with_error("a", 9.0, 5.0),
      run_with_error("b", 2.5, 12.0, 8.0),   run_with_error("b", 4.0, 10.0, 4.0),
      run_with_error("b", -1.0, 20.0, 10.0), run_with_error("b", 30.0, 19.0, 3.0)};
  const std::vector<GroupStatistics> groups = statistics_by_group(runs, {0.0, 10.0, 20.0});
  ASSERT_EQ(groups.size(), 2U);
  EXPECT_EQ(groups[0].name, "a");
  EXPECT_EQ(groups[0].success_rate(), 0.0);
  EXPECT_TRUE(std::isnan(groups[0].succeeded.mean));
  const GroupStatistics& b = groups[1];
  EXPECT_EQ(b.runs, 5U);
  EXPECT_EQ(b.refused, 1U);
  EXPECT_EQ(b.succeeded.count, 3U);
  EXPECT_DOUBLE_EQ(b.succeeded.mean, 2.5);
  EXPECT_DOUBLE_EQ(b.succeeded.deviation, 1.5);
  EXPECT_DOUBLE_EQ(b.accepted.mean, 37.5 / 4.0);
  EXPECT_DOUBLE_EQ(b.accepted.median, 3.25);
  EXPECT_DOUBLE_EQ(b.accepted.max, 30.0);
  EXPECT_DOUBLE_EQ(b.accepted_physical.mean, 41.5 / 4.0);
  EXPECT_DOUBLE_EQ(b.accepted_physical.max, 31.0);
  EXPECT_DOUBLE_EQ(b.share_below[0], 0.2);
  EXPECT_DOUBLE_EQ(b.share_below[1], 0.4);
  EXPECT_DOUBLE_EQ(b.success_rate(), 0.6);
  EXPECT_DOUBLE_EQ(b.seconds.median, 4.0);
  ASSERT_EQ(b.bins.size(), 2U);
  EXPECT_EQ(b.bins[0].runs, 1U);
  EXPECT_EQ(b.bins[0].succeeded, 1U);
  EXPECT_EQ(b.bins[1].runs, 4U);  // 10 belongs to the second, 20 is its end
  EXPECT_EQ(b.bins[1].succeeded, 2U);
}

TEST(GroupStatistics, ByCaseKeepsCasesApart) {
  std::vector<StudyRun> runs{run_with_error("a", 1.0), run_with_error("a", 2.0)};
  runs[1].case_name = "a_2";
  const std::vector<GroupStatistics> cases = statistics_by_case(runs, {});
  ASSERT_EQ(cases.size(), 2U);
  EXPECT_EQ(cases[1].name, "a_2");
  EXPECT_DOUBLE_EQ(cases[1].succeeded.mean, 2.0);
}

TEST(NegativeStatistics, CountEveryAcceptanceWithoutTruthAsWrong) {
  std::vector<StudyRun> runs;
  const auto add = [&](TrialKind kind, double error_mm) {
    runs.push_back(run_with_error("a", error_mm));
    runs.back().trial.kind = kind;
    if (!has_truth(kind)) runs.back().after.reset();
  };
  add(TrialKind::kStart, 1.0);
  add(TrialKind::kNoise, -1.0);
  add(TrialKind::kNoise, 0.0);
  add(TrialKind::kNoise, -1.0);
  runs.back().result.status = RegistrationStatus::kNoOverlap;
  add(TrialKind::kFarStart, 2.0);
  add(TrialKind::kFarStart, 5.5);
  const std::vector<NegativeStatistics> kinds = negative_statistics(runs);
  ASSERT_EQ(kinds.size(), 2U);
  EXPECT_EQ(kinds[0].kind, TrialKind::kNoise);
  EXPECT_EQ(kinds[0].runs, 3U);
  EXPECT_EQ(kinds[0].refused.at("low_confidence"), 1U);
  EXPECT_EQ(kinds[0].refused.at("no_overlap"), 1U);
  EXPECT_EQ(kinds[0].accepted_right, 0U);
  EXPECT_EQ(kinds[0].accepted_wrong, 1U);
  EXPECT_EQ(kinds[1].accepted_right, 1U);
  EXPECT_EQ(kinds[1].accepted_wrong, 1U);
  // Negative trials are in none of the tables of errors.
  EXPECT_EQ(statistics_by_group(runs, {})[0].runs, 1U);
}

// If none of n trials happened, (1 - p)^n = 0.05; if all but one did, 1 - p^n = 0.05.
TEST(ShareUpperBound, IsExactWhereItHasAClosedForm) {
  EXPECT_NEAR(share_upper_bound(0, 3000), 1.0 - std::pow(0.05, 1.0 / 3000.0), 1e-12);
  EXPECT_NEAR(share_upper_bound(9, 10), std::pow(0.95, 1.0 / 10.0), 1e-12);
  EXPECT_EQ(share_upper_bound(7, 7), 1.0);
  EXPECT_TRUE(std::isnan(share_upper_bound(0, 0)));
  expect_input_error([] { share_upper_bound(3, 2); }, {"3 in 2"});
}

RC_GTEST_PROP(ShareUpperBound, IsTheProbabilityThatSoFewHaveInFivePercentOfStudies, ()) {
  const int runs = integer(1, 200);
  const int count = integer(0, runs - 1);
  const double p =
      share_upper_bound(static_cast<std::size_t>(count), static_cast<std::size_t>(runs));
  double at_most_count = 0.0;
  for (int k = 0; k <= count; ++k)
    at_most_count +=
        std::exp(std::lgamma(runs + 1.0) - std::lgamma(k + 1.0) - std::lgamma(runs - k + 1.0) +
                 k * std::log(p) + (runs - k) * std::log1p(-p));
  RC_ASSERT(std::abs(at_most_count - 0.05) < 1e-9);
}

TEST(Calibration, ComparesExpectedWithPhysicalErrors) {
  std::vector<StudyRun> runs;
  const auto add = [&](double expected_mm, double physical_mm) {
    runs.push_back(run_with_error("a", physical_mm - 1.0));
    runs.back().expected = ExpectedTargetErrors{expected_mm, expected_mm};
  };
  add(1.0, 3.0);
  add(2.0, 4.0);
  add(4.0, 1.0);
  runs.push_back(run_with_error("a", 2.0));  // no expected error
  const Calibration calibration = calibration_of(runs, {0.0, 3.0, 10.0, 20.0});
  ASSERT_EQ(calibration.bins.size(), 2U);
  EXPECT_EQ(calibration.bins[0].runs, 2U);
  EXPECT_DOUBLE_EQ(calibration.bins[0].mean_expected_mm, 1.5);
  EXPECT_DOUBLE_EQ(calibration.bins[0].mean_true_mm, 3.5);
  EXPECT_DOUBLE_EQ(calibration.bins[0].rms_ratio, std::sqrt(25.0 / 5.0));
  EXPECT_DOUBLE_EQ(calibration.bins[0].share_within_twice, 0.5);
  EXPECT_EQ(calibration.all.runs, 3U);
  EXPECT_DOUBLE_EQ(calibration.all.rms_ratio, std::sqrt(26.0 / 21.0));
  EXPECT_DOUBLE_EQ(calibration.all.share_within_twice, 2.0 / 3.0);
  EXPECT_NEAR(calibration.rank_correlation, -0.5, 1e-12);
}

}  // namespace
}  // namespace usct::test
