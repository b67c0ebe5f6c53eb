#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "us_ct_registration/evaluation/study_run.h"
#include "us_ct_registration/evaluation/study_statistics.h"

/// Statistics of several methods of a study. Runs from starts of one case are not independent,
/// since they share its images, and neither are cases of one subject, which share its anatomy, so
/// that intervals and tests are over subjects; see subject_of.
namespace usct {

/// A 95 % confidence interval; NaN if there are too few subjects.
struct Interval {
  double low = std::numeric_limits<double>::quiet_NaN();
  double high = std::numeric_limits<double>::quiet_NaN();
};

/// The values of one subject.
struct SubjectValues {
  double sum = 0.0;
  std::size_t count = 0;
};

/// Interval of the mean of all values by the percentiles of a bootstrap over subjects (Davison and
/// Hinkley 1997, 3.8): subjects are drawn with replacement, each with all its values. Draws without
/// any value do not count. NaN for fewer than two subjects. The same seed gives the same bits.
Interval bootstrap_over_subjects(const std::vector<SubjectValues>& subjects, std::uint64_t seed = 1,
                                 int draws = 10000);

/// A test of whether the mean of differences, one of each subject, is other than 0. Members that
/// need more values than there are, or values that differ, are NaN.
struct PairedTest {
  std::size_t subjects = 0;
  double mean = std::numeric_limits<double>::quiet_NaN();
  /// Student's t with subjects - 1 degrees of freedom, and the two-sided probability of one as
  /// large by chance.
  double t = std::numeric_limits<double>::quiet_NaN();
  double p = std::numeric_limits<double>::quiet_NaN();
  Interval bootstrap;
};
PairedTest paired_test(const std::vector<double>& differences);

/// Statistics of some runs from starts near the truth. Errors are TREs against the rigid truth.
struct RunStatistics {
  std::size_t cases = 0;
  std::size_t subjects = 0;
  std::size_t runs = 0;
  std::size_t refused = 0;
  /// Number of runs that were accepted with an error below the study's `success_mm`, and the share
  /// of all runs that they are, refused ones too.
  std::size_t succeeded = 0;
  double success_rate = std::numeric_limits<double>::quiet_NaN();
  Interval success_interval;
  /// Errors of the accepted runs, and the interval of their mean; and errors of the succeeded runs.
  Summary accepted_mm;
  Interval mean_interval_mm;
  Summary succeeded_mm;
};
RunStatistics statistics_of(const std::vector<const StudyRun*>& runs, double success_mm);

/// Two methods, compared subject by subject.
struct MethodComparison {
  std::string first;
  std::string second;
  /// Errors of the second method less those of the first, mm: the mean of each subject over the
  /// starts from which both were accepted.
  PairedTest error_mm;
  /// Success rate of the second method less that of the first, over all starts.
  PairedTest success;
};

/// All pairs of methods, in the order in which methods first occur in the runs, by their runs from
/// starts near the truth.
std::vector<MethodComparison> compare_methods(const std::vector<StudyRun>& runs, double success_mm);

}  // namespace usct
