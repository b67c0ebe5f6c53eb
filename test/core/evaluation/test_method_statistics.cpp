#include <gtest/gtest.h>

#include <cmath>

#include "core/evaluation/small_study.h"
#include "evaluation/method_statistics.h"
#include "us_ct_registration/evaluation/study_tables.h"

namespace usct::test {
namespace {

/// Additional hours of sleep by the second of two drugs less those by the first, ten patients:
/// Student, "The probable error of a mean", Biometrika 6 (1908), table on p. 20.
const std::vector<double> kSleep{1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4};

StudyRun run_of(const std::string& method, const std::string& case_name, int start, double error_mm,
                double displacement_mm = 0.0) {
  StudyRun run = run_with_error("g", error_mm, displacement_mm);
  run.method = method;
  run.case_name = case_name;
  run.trial.index = start;
  return run;
}

// numpy.percentile([3.1, 0.4, 7.7, 2.2, 5.0, 9.6, 1.3], [2.5, 50, 95, 97.5]) of numpy 1.24.
TEST(Quantile, IsThatOfNumpy) {
  const std::vector<double> rising{0.4, 1.3, 2.2, 3.1, 5.0, 7.7, 9.6};
  EXPECT_NEAR(quantile(rising, 0.025), 0.535, 1e-12);
  EXPECT_NEAR(quantile(rising, 0.5), 3.1, 1e-12);
  EXPECT_NEAR(quantile(rising, 0.95), 9.03, 1e-12);
  EXPECT_NEAR(quantile(rising, 0.975), 9.315, 1e-12);
  EXPECT_EQ(quantile(rising, 1.0), 9.6);
  EXPECT_EQ(quantile({4.0}, 0.3), 4.0);
}

// R's documentation of t.test has these data: t = -4.0621, df = 9, p-value = 0.002833 for the first
// drug less the second. The digits are those of scipy.stats.ttest_rel of scipy 1.10; the interval
// is that of scipy.stats.bootstrap(method="percentile") with 400,000 draws.
TEST(PairedTest, IsThatOfStudentsSleepData) {
  const PairedTest test = paired_test(kSleep);
  EXPECT_EQ(test.subjects, 10U);
  EXPECT_NEAR(test.mean, 1.58, 1e-12);
  EXPECT_NEAR(test.t, 4.062127683382037, 1e-12);
  EXPECT_NEAR(test.p, 0.00283289019738427, 1e-12);
  EXPECT_NEAR(test.bootstrap.low, 0.95, 0.03);
  EXPECT_NEAR(test.bootstrap.high, 2.38, 0.04);
}

TEST(PairedTest, TellsOnlyWhatItsValuesAllow) {
  EXPECT_TRUE(std::isnan(paired_test({}).mean));
  EXPECT_EQ(paired_test({2.0}).mean, 2.0);
  EXPECT_TRUE(std::isnan(paired_test({2.0}).p));
  EXPECT_TRUE(std::isnan(paired_test({2.0}).bootstrap.low));
  EXPECT_TRUE(std::isnan(paired_test({1.5, 1.5}).t));
  EXPECT_TRUE(std::isnan(paired_test({-0.1, -0.1, -0.1}).p));  // whose mean is rounded
  EXPECT_EQ(paired_test({1.5, 1.5}).bootstrap.high, 1.5);
}

// If all runs of a subject succeed or all fail, the number of those that succeed in a draw is
// binomial, whatever the number of starts: with 9 of 12 cases, the quantiles of B(12, 3/4) at 2.5
// and 97.5 % are 6 and 12 (scipy.stats.binom.ppf).
TEST(BootstrapOverSubjects, IsBinomialWhereStartsOfASubjectAgree) {
  for (const std::size_t starts : {1U, 50U}) {
    std::vector<SubjectValues> subjects;
    for (int i = 0; i < 12; ++i)
      subjects.push_back({i < 9 ? static_cast<double>(starts) : 0.0, starts});
    const Interval interval = bootstrap_over_subjects(subjects);
    EXPECT_DOUBLE_EQ(interval.low, 6.0 / 12.0);
    EXPECT_DOUBLE_EQ(interval.high, 1.0);
  }
}

// Cases of different sizes: the quantiles over all 4^4 draws, enumerated with numpy.
TEST(BootstrapOverSubjects, WeighsSubjectsByTheirRuns) {
  const Interval interval = bootstrap_over_subjects({{3.0, 1}, {10.0, 4}, {1.0, 2}, {6.0, 3}});
  EXPECT_DOUBLE_EQ(interval.low, 1.0);
  EXPECT_DOUBLE_EQ(interval.high, 2.6);
}

TEST(BootstrapOverSubjects, LeavesOutDrawsWithoutValues) {
  const Interval interval = bootstrap_over_subjects({{8.0, 2}, {0.0, 0}});
  EXPECT_DOUBLE_EQ(interval.low, 4.0);
  EXPECT_DOUBLE_EQ(interval.high, 4.0);
  EXPECT_TRUE(std::isnan(bootstrap_over_subjects({{8.0, 2}}).low));
  EXPECT_TRUE(std::isnan(bootstrap_over_subjects({{0.0, 0}, {0.0, 0}}).low));
}

// Case a: errors 1, 2 and refused; case b: 4 and 12. Four of five are accepted, three below 5 mm.
TEST(RunStatistics, AreOfAllRunsAndOfTheAcceptedOnes) {
  const std::vector<StudyRun> runs{run_of("m", "a", 0, 1.0), run_of("m", "a", 1, 2.0),
                                   run_of("m", "a", 2, -1.0), run_of("m", "b", 0, 4.0),
                                   run_of("m", "b", 1, 12.0)};
  std::vector<const StudyRun*> pointers;
  for (const StudyRun& run : runs) pointers.push_back(&run);
  const RunStatistics statistics = statistics_of(pointers, 5.0);
  EXPECT_EQ(statistics.cases, 2U);
  EXPECT_EQ(statistics.runs, 5U);
  EXPECT_EQ(statistics.refused, 1U);
  EXPECT_EQ(statistics.succeeded, 3U);
  EXPECT_DOUBLE_EQ(statistics.success_rate, 0.6);
  EXPECT_DOUBLE_EQ(statistics.accepted_mm.mean, 19.0 / 4.0);
  EXPECT_DOUBLE_EQ(statistics.accepted_mm.median, 3.0);
  EXPECT_DOUBLE_EQ(statistics.accepted_mm.max, 12.0);
  EXPECT_DOUBLE_EQ(statistics.succeeded_mm.mean, 7.0 / 3.0);
  // Draws are aa (1/4), ab or ba (1/2) and bb (1/4).
  EXPECT_DOUBLE_EQ(statistics.success_interval.low, 1.0 / 2.0);
  EXPECT_DOUBLE_EQ(statistics.success_interval.high, 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(statistics.mean_interval_mm.low, 1.5);
  EXPECT_DOUBLE_EQ(statistics.mean_interval_mm.high, 8.0);
  EXPECT_EQ(statistics_of(pointers, 15.0).succeeded, 4U);
}

// Starts of one case are not independent, and neither are cases with the same kidney.
TEST(RunStatistics, CountsCasesOfOneSubjectOnce) {
  std::vector<StudyRun> runs;
  for (const char* name : {"agar_1", "patient_1", "agar_2", "patient_2"})
    runs.push_back(run_of("m", name, 0, name[std::string(name).size() - 1] == '1' ? 1.0 : 9.0));
  std::vector<const StudyRun*> pointers;
  for (const StudyRun& run : runs) pointers.push_back(&run);
  const RunStatistics statistics = statistics_of(pointers, 5.0);
  EXPECT_EQ(statistics.cases, 4U);
  EXPECT_EQ(statistics.subjects, 2U);
  // Of two subjects a draw has one, both or the other; of four cases hardly any would have one.
  EXPECT_DOUBLE_EQ(statistics.success_interval.low, 0.0);
  EXPECT_DOUBLE_EQ(statistics.success_interval.high, 1.0);
  std::vector<StudyRun> pairs = runs;
  for (StudyRun& run : runs) {
    run.method = "n";
    pairs.push_back(run);
  }
  EXPECT_EQ(compare_methods(pairs, 5.0).at(0).success.subjects, 2U);
}

// The patients of the sleep data as cases, with two starts each: the second method is worse by the
// sleep difference on average, and by 1 mm more or less at either start. A start from which one
// method was refused counts for success alone.
TEST(CompareMethods, PairsStartsAndTestsSubjects) {
  std::vector<StudyRun> runs;
  for (std::size_t i = 0; i < kSleep.size(); ++i) {
    const std::string name = "case_" + std::to_string(i);
    runs.push_back(run_of("first", name, 0, 3.0));
    runs.push_back(run_of("first", name, 1, 1.0));
    runs.push_back(run_of("first", name, 2, 2.0));
    runs.push_back(run_of("second", name, 0, 3.0 + kSleep[i] + 1.0));
    runs.push_back(run_of("second", name, 1, 1.0 + kSleep[i] - 1.0));
    runs.push_back(run_of("second", name, 2, -1.0));
  }
  const std::vector<MethodComparison> comparisons = compare_methods(runs, 100.0);
  ASSERT_EQ(comparisons.size(), 1U);
  EXPECT_EQ(comparisons[0].first, "first");
  EXPECT_EQ(comparisons[0].second, "second");
  EXPECT_EQ(comparisons[0].error_mm.subjects, 10U);
  EXPECT_NEAR(comparisons[0].error_mm.t, 4.062127683382037, 1e-9);
  EXPECT_NEAR(comparisons[0].success.mean, -1.0 / 3.0, 1e-12);
}

TEST(MethodTables, TellMethodsBinsAndPairs) {
  Study study;
  study.methods = {{"m", {}, {}}, {"n", {}, {}}};
  study.starts.max_displacement_mm = 20.0;
  study.starts.bins = 2;
  std::vector<StudyRun> runs;
  for (const char* name : {"a", "b"})
    for (int start = 0; start < 2; ++start) {
      runs.push_back(run_of("m", name, start, 1.0 + start, 20.0 * start));
      runs.push_back(run_of("n", name, start, start == 0 ? 2.0 : -1.0, 20.0 * start));
    }
  const auto expect_row = [](const Table& table, const std::string& row) {
    EXPECT_NE(markdown(table).find(row), std::string::npos) << markdown(table);
  };
  expect_row(
      methods_table(study, runs),
      "| m | 2 | 2 | 4 | 0 | 100.0 | 100.0 to 100.0 | 1.50 | 1.50 to 1.50 | 1.50 | 2.00 | 2.00 |");
  expect_row(
      bins_table(study, runs),
      "| m | 10-20 mm | 2 | 2 | 2 | 0 | 100.0 | 100.0 to 100.0 | 2.00 | 2.00 to 2.00 | 2.00 |");
  expect_row(bins_table(study, runs),
             "| n | 10-20 mm | 2 | 2 | 2 | 2 | 0.0 | 0.0 to 0.0 | - | - | - |");
  expect_row(groups_table(study, runs), "| n | g | 2 | 2 | 4 | 2 | 50.0 |");
  expect_row(cases_table(study, runs), "| m | b | 2 | 0 | 100.0 | 1.50 | 0.71 | 1.50 | 2.00 |");
  expect_row(comparisons_table(study, runs),
             "| m | n | 2 (TRE: 2) | 1.000 | 1.000 to 1.000 | - | - | -50.0 | -50.0 to -50.0 |");
  expect_row(costs_table(study, runs), "| m | 4 | 1.00 | 1.00 | 1.00 | 1.00 | 0 | 0 | - | - |");
}

}  // namespace
}  // namespace usct::test
