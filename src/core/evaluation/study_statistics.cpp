#include "us_ct_registration/evaluation/study_statistics.h"

#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <cmath>
#include <limits>
#include <numeric>

#include "us_ct_registration/error.h"

namespace usct {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double share(std::size_t part, std::size_t all) {
  return all == 0 ? kNaN : static_cast<double>(part) / static_cast<double>(all);
}

double mean_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// Ranks, counted from 1; equal values share their mean rank.
std::vector<double> ranks_of(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  std::vector<double> ranks(values.size());
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin;
    while (end < order.size() && values[order[end]] == values[order[begin]]) ++end;
    for (std::size_t i = begin; i < end; ++i)
      ranks[order[i]] = 0.5 * static_cast<double>(begin + 1 + end);
    begin = end;
  }
  return ranks;
}

std::vector<DisplacementBin> empty_bins(const std::vector<double>& edges_mm) {
  std::vector<DisplacementBin> bins(edges_mm.empty() ? 0 : edges_mm.size() - 1);
  for (std::size_t i = 0; i < bins.size(); ++i) bins[i] = {edges_mm[i], edges_mm[i + 1], 0, 0};
  return bins;
}

GroupStatistics statistics_of(const std::string& name, const std::vector<const StudyRun*>& runs,
                              const std::vector<double>& bin_edges_mm) {
  GroupStatistics group;
  group.name = name;
  group.runs = runs.size();
  group.bins = empty_bins(bin_edges_mm);
  std::vector<double> accepted_mm;
  std::vector<double> physical_mm;
  std::vector<double> succeeded_mm;
  std::vector<double> seconds;
  for (const StudyRun* run : runs) {
    seconds.push_back(run->seconds());
    if (run->after) {
      accepted_mm.push_back(run->after->rigid.mean_mm);
      physical_mm.push_back(run->after->physical.mean_mm);
    }
    const bool succeeded = run->after && accepted_mm.back() < kSuccessMm;
    if (succeeded) succeeded_mm.push_back(accepted_mm.back());
    if (const auto bin = bin_of(run->trial.displacement_mm, bin_edges_mm)) {
      ++group.bins[*bin].runs;
      if (succeeded) ++group.bins[*bin].succeeded;
    }
  }
  for (std::size_t i = 0; i < GroupStatistics::kBelowMm.size(); ++i) {
    const auto below = std::count_if(accepted_mm.begin(), accepted_mm.end(), [&](double error_mm) {
      return error_mm < GroupStatistics::kBelowMm[i];
    });
    group.share_below[i] = share(static_cast<std::size_t>(below), group.runs);
  }
  group.refused = group.runs - accepted_mm.size();
  group.accepted = summary_of(accepted_mm);
  group.accepted_physical = summary_of(physical_mm);
  group.succeeded = summary_of(succeeded_mm);
  group.seconds = summary_of(seconds);
  return group;
}

template <typename NameOf>
std::vector<GroupStatistics> statistics_by(const std::vector<StudyRun>& runs,
                                           const std::vector<double>& bin_edges_mm,
                                           const NameOf& name_of) {
  std::map<std::string, std::vector<const StudyRun*>> runs_of;
  for (const StudyRun& run : runs)
    if (run.trial.kind == TrialKind::kStart) runs_of[name_of(run)].push_back(&run);
  std::vector<GroupStatistics> groups;
  groups.reserve(runs_of.size());
  for (const auto& [name, of_group] : runs_of)
    groups.push_back(statistics_of(name, of_group, bin_edges_mm));
  return groups;
}

struct Pair {
  double expected_mm;
  double true_mm;
};

CalibrationBin calibration_bin(double low_mm, double high_mm, const std::vector<Pair>& pairs) {
  CalibrationBin bin{low_mm, high_mm, 0, 0.0, 0.0, 0.0, 0.0};
  double expected_squares = 0.0;
  double true_squares = 0.0;
  std::size_t within_twice = 0;
  for (const Pair& pair : pairs) {
    if (pair.expected_mm < low_mm || pair.expected_mm >= high_mm) continue;
    ++bin.runs;
    bin.mean_expected_mm += pair.expected_mm;
    bin.mean_true_mm += pair.true_mm;
    expected_squares += pair.expected_mm * pair.expected_mm;
    true_squares += pair.true_mm * pair.true_mm;
    if (pair.true_mm <= 2.0 * pair.expected_mm) ++within_twice;
  }
  bin.mean_expected_mm /= static_cast<double>(bin.runs);
  bin.mean_true_mm /= static_cast<double>(bin.runs);
  bin.rms_ratio = std::sqrt(true_squares / expected_squares);
  bin.share_within_twice = share(within_twice, bin.runs);
  return bin;
}

}  // namespace

std::optional<std::size_t> bin_of(double displacement_mm, const std::vector<double>& bin_edges_mm) {
  constexpr double kSameMm = 1e-6;
  if (bin_edges_mm.size() < 2 || !(displacement_mm >= bin_edges_mm.front() - kSameMm) ||
      !(displacement_mm <= bin_edges_mm.back() + kSameMm))
    return std::nullopt;
  std::size_t bin = 0;
  while (bin + 2 < bin_edges_mm.size() && displacement_mm >= bin_edges_mm[bin + 1]) ++bin;
  return bin;
}

Summary summary_of(std::vector<double> values) {
  Summary summary{values.size(), kNaN, kNaN, kNaN, kNaN, kNaN};
  if (values.empty()) return summary;
  std::sort(values.begin(), values.end());
  summary.mean = mean_of(values);
  summary.median = quantile(values, 0.5);
  summary.percentile_95 = quantile(values, 0.95);
  summary.max = values.back();
  if (values.size() == 1) return summary;
  double squares = 0.0;
  for (const double value : values) squares += (value - summary.mean) * (value - summary.mean);
  summary.deviation = std::sqrt(squares / static_cast<double>(values.size() - 1));
  return summary;
}

double quantile(const std::vector<double>& rising, double share) {
  const double place = share * static_cast<double>(rising.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, rising.size() - 1);
  return rising[below] + (place - static_cast<double>(below)) * (rising[above] - rising[below]);
}

double spearman_correlation(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size())
    throw InputError("rank correlation", "has " + std::to_string(a.size()) + " and " +
                                             std::to_string(b.size()) + " values, must be equal");
  if (a.size() < 2) return kNaN;
  const std::vector<double> rank_a = ranks_of(a);
  const std::vector<double> rank_b = ranks_of(b);
  const double mean = 0.5 * static_cast<double>(a.size() + 1);
  double ab = 0.0;
  double aa = 0.0;
  double bb = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += (rank_a[i] - mean) * (rank_b[i] - mean);
    aa += (rank_a[i] - mean) * (rank_a[i] - mean);
    bb += (rank_b[i] - mean) * (rank_b[i] - mean);
  }
  return aa > 0.0 && bb > 0.0 ? ab / std::sqrt(aa * bb) : kNaN;
}

std::vector<GroupStatistics> statistics_by_group(const std::vector<StudyRun>& runs,
                                                 const std::vector<double>& bin_edges_mm) {
  return statistics_by(runs, bin_edges_mm, [](const StudyRun& run) { return run.group; });
}

std::vector<GroupStatistics> statistics_by_case(const std::vector<StudyRun>& runs,
                                                const std::vector<double>& bin_edges_mm) {
  return statistics_by(runs, bin_edges_mm, [](const StudyRun& run) { return run.case_name; });
}

double share_upper_bound(std::size_t count, std::size_t runs) {
  if (count > runs)
    throw InputError("share", "is of " + std::to_string(count) + " in " + std::to_string(runs) +
                                  ", must be of at most all");
  if (runs == 0) return kNaN;
  if (count == runs) return 1.0;
  return boost::math::binomial_distribution<>::find_upper_bound_on_p(
      static_cast<double>(runs), static_cast<double>(count), 0.05);
}

std::vector<NegativeStatistics> negative_statistics(const std::vector<StudyRun>& runs) {
  std::map<TrialKind, NegativeStatistics> of_kind;
  for (const StudyRun& run : runs) {
    if (run.trial.kind == TrialKind::kStart) continue;
    NegativeStatistics& negatives = of_kind[run.trial.kind];
    negatives.kind = run.trial.kind;
    ++negatives.runs;
    if (!run.accepted())
      ++negatives.refused[status_name(run.result.status)];
    else if (run.after && run.after->rigid.mean_mm < kSuccessMm)
      ++negatives.accepted_right;
    else
      ++negatives.accepted_wrong;
  }
  std::vector<NegativeStatistics> result;
  result.reserve(of_kind.size());
  for (const auto& [kind, negatives] : of_kind) result.push_back(negatives);
  return result;
}

Calibration calibration_of(const std::vector<StudyRun>& runs,
                           const std::vector<double>& bin_edges_mm) {
  std::vector<Pair> pairs;
  std::vector<double> expected_mm;
  std::vector<double> true_mm;
  for (const StudyRun& run : runs) {
    if (!run.after || !run.expected) continue;
    pairs.push_back({run.expected->rms_mm, run.after->physical.rms_mm});
    expected_mm.push_back(run.expected->rms_mm);
    true_mm.push_back(run.after->physical.rms_mm);
  }
  Calibration calibration;
  for (std::size_t i = 1; i < bin_edges_mm.size(); ++i) {
    const CalibrationBin bin = calibration_bin(bin_edges_mm[i - 1], bin_edges_mm[i], pairs);
    if (bin.runs > 0) calibration.bins.push_back(bin);
  }
  calibration.all = calibration_bin(0.0, std::numeric_limits<double>::infinity(), pairs);
  calibration.rank_correlation = spearman_correlation(expected_mm, true_mm);
  return calibration;
}

}  // namespace usct
