#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "us_ct_registration/evaluation/study_run.h"

/// Statistics of the runs of a study. Errors are means over the targets of a case, in mm, against
/// the rigid truth unless they are called physical.
namespace usct {

/// A run has succeeded, or converged, if it was accepted with an error below this.
constexpr double kSuccessMm = 5.0;

/// Statistics of several numbers; NaN if there are too few.
struct Summary {
  std::size_t count = 0;
  double mean = 0.0;
  double median = 0.0;
  /// Sample standard deviation (denominator count - 1).
  double deviation = 0.0;
  double percentile_95 = 0.0;
  double max = 0.0;
};
Summary summary_of(std::vector<double> values);

/// The value below which `share` (in [0, 1]) of the rising, non-empty values lie, interpolated
/// linearly between the two next ones (type 7 of Hyndman and Fan 1996, the default of R and numpy).
double quantile(const std::vector<double>& rising, double share);

/// Rank correlation; equal values share their mean rank. NaN for fewer than two pairs, or if all
/// values of one sequence are equal. Throws InputError if the numbers of values differ.
double spearman_correlation(const std::vector<double>& a, const std::vector<double>& b);

/// Starts with displacements in [low_mm, high_mm); the last bin includes its end.
struct DisplacementBin {
  double low_mm = 0.0;
  double high_mm = 0.0;
  std::size_t runs = 0;
  std::size_t succeeded = 0;
};

/// Runs from starts near the truth.
struct GroupStatistics {
  std::string name;
  std::size_t runs = 0;
  std::size_t refused = 0;
  Summary succeeded;  // errors
  Summary accepted;
  Summary accepted_physical;
  /// Share of all runs, refused ones too, that were accepted with an error below 2, 3 and 5 mm.
  static constexpr std::array<double, 3> kBelowMm{2.0, 3.0, kSuccessMm};
  std::array<double, 3> share_below{};
  Summary seconds;
  std::vector<DisplacementBin> bins;

  double success_rate() const { return share_below.back(); }
};

/// The number of the bin [edge, next edge) in which a start lies; empty if it is in none. The ends
/// of the range belong to it, and are meant within 1e-6 mm: a displacement is computed from a pose.
std::optional<std::size_t> bin_of(double displacement_mm, const std::vector<double>& bin_edges_mm);

/// Statistics of the runs of kind kStart, by group or by case, in the order of names.
/// `bin_edges_mm` rise; starts outside are in no bin.
std::vector<GroupStatistics> statistics_by_group(const std::vector<StudyRun>& runs,
                                                 const std::vector<double>& bin_edges_mm);
std::vector<GroupStatistics> statistics_by_case(const std::vector<StudyRun>& runs,
                                                const std::vector<double>& bin_edges_mm);

/// Upper end of the exact one-sided 95 % confidence interval (Clopper and Pearson 1934) of a
/// probability, if it happened `count` times in `runs` independent trials: the probability with
/// which so few would be seen in 5 % of all studies. 1 if all trials did, NaN if there is none.
/// Throws InputError if `count` exceeds `runs`.
double share_upper_bound(std::size_t count, std::size_t runs);

/// Negative trials of one kind.
struct NegativeStatistics {
  TrialKind kind = TrialKind::kMismatched;
  std::size_t runs = 0;
  /// Number of refused runs by the name of their status.
  std::map<std::string, std::size_t> refused;
  std::size_t accepted_right = 0;
  /// Number of accepted runs that have no truth, or an error of kSuccessMm or more.
  std::size_t accepted_wrong = 0;
  /// Upper end of the exact 95 % interval of the share that is accepted and wrong.
  double wrong_share_bound() const { return share_upper_bound(accepted_wrong, runs); }
};
/// Statistics of each kind that occurs, in the order of TrialKind.
std::vector<NegativeStatistics> negative_statistics(const std::vector<StudyRun>& runs);

/// Expected against physical errors, both RMS over the targets of a case, of accepted runs that
/// have both.
struct CalibrationBin {
  /// Expected errors in [low_mm, high_mm).
  double low_mm = 0.0;
  double high_mm = 0.0;
  std::size_t runs = 0;
  double mean_expected_mm = 0.0;
  double mean_true_mm = 0.0;
  /// RMS of the true errors over RMS of the expected ones: 1 if covariances are right.
  double rms_ratio = 0.0;
  /// Share of true errors that are at most twice the expected one.
  double share_within_twice = 0.0;
};
struct Calibration {
  std::vector<CalibrationBin> bins;  // those that hold runs
  CalibrationBin all;
  double rank_correlation = 0.0;
};
Calibration calibration_of(const std::vector<StudyRun>& runs,
                           const std::vector<double>& bin_edges_mm = {0.0, 0.5, 1.0, 1.5, 2.0, 3.0,
                                                                      5.0, 10.0, 1e9});

}  // namespace usct
