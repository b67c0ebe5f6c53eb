#include "ultrasound/lag_correlation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace usct {
namespace {

constexpr double kLargestLag_s = 1.5;
constexpr double kLagStep_s = 0.02;
constexpr double kTrend_s = 1.0;
constexpr int kResamples = 200;

/// Correlation over pairs with integer weights; kUnknownCorrelation if fewer than half of them have
/// a speed.
double correlation(const std::vector<double>& a, const std::vector<double>& b,
                   const std::vector<int>& weights) {
  double n = 0, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0, all = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double w = weights[i];
    all += w;
    if (w == 0.0 || std::isnan(b[i])) continue;
    n += w;
    sa += w * a[i];
    sb += w * b[i];
    saa += w * a[i] * a[i];
    sbb += w * b[i] * b[i];
    sab += w * a[i] * b[i];
  }
  if (n < 0.5 * all || n < 3.0) return kUnknownCorrelation;
  const double variance_a = saa - sa * sa / n;
  const double variance_b = sbb - sb * sb / n;
  // Values are of the order of one; smaller ones than this are rounding errors.
  constexpr double kRounding = 1e-12;
  if (variance_a < kRounding || variance_b < kRounding) return kUnknownCorrelation;
  return (sab - sa * sb / n) / std::sqrt(variance_a * variance_b);
}

double autocorrelation(const std::vector<double>& values, const Moments& m, std::size_t lag) {
  double sum = 0.0;
  for (std::size_t i = 0; i + lag < values.size(); ++i)
    sum += (values[i] - m.mean) * (values[i + lag] - m.mean);
  return sum / (static_cast<double>(values.size()) * m.deviation * m.deviation);
}

/// The number of independent pairs of values to which two smooth signals are equivalent (Bartlett).
double independent_pairs(const std::vector<double>& a, const std::vector<double>& b) {
  const Moments ma = moments(a);
  const Moments mb = moments(b);
  double spread = 1.0;
  for (std::size_t lag = 1; lag < a.size() / 2; ++lag)
    spread += 2.0 * autocorrelation(a, ma, lag) * autocorrelation(b, mb, lag);
  return static_cast<double>(a.size()) / std::max(1.0, spread);
}

/// Gaussian windows of three standard deviations around each of some times.
class Windows {
 public:
  Windows(const std::vector<double>& times_s, double sigma_s) {
    std::size_t begin = 0;
    for (const double time_s : times_s) {
      while (times_s[begin] < time_s - 3.0 * sigma_s) ++begin;
      Window window{begin, {}};
      for (std::size_t i = begin; i < times_s.size() && times_s[i] <= time_s + 3.0 * sigma_s; ++i)
        window.weights.push_back(std::exp(-0.5 * std::pow((times_s[i] - time_s) / sigma_s, 2)));
      windows_.push_back(std::move(window));
    }
  }

  /// Subtracts from each value of both signals the mean of its window, over the times at which
  /// `speed` is known.
  void detrend(std::vector<double>& change, std::vector<double>& speed) const {
    const std::vector<double> changes = change;
    const std::vector<double> speeds = speed;
    for (std::size_t i = 0; i < windows_.size(); ++i) {
      if (std::isnan(speeds[i])) continue;
      double weights = 0.0, of_change = 0.0, of_speed = 0.0;
      std::size_t at = windows_[i].begin;
      for (const double weight : windows_[i].weights) {
        if (!std::isnan(speeds[at])) {
          weights += weight;
          of_change += weight * changes[at];
          of_speed += weight * speeds[at];
        }
        ++at;
      }
      change[i] -= of_change / weights;
      speed[i] -= of_speed / weights;
    }
  }

 private:
  struct Window {
    std::size_t begin;
    std::vector<double> weights;
  };
  std::vector<Window> windows_;
};

}  // namespace

ShiftedSpeeds shift_speed(const Signal& change, const Signal& speed, double sigma_s) {
  ShiftedSpeeds shifted;
  std::vector<double> smooth_change;
  for (const double time_s : change.times_s)
    smooth_change.push_back(*smoothed(change, time_s, sigma_s));
  const Windows trend(change.times_s, std::max(kTrend_s, 3.0 * sigma_s));
  const double reach_s =
      std::min(kLargestLag_s, 0.5 * (speed.times_s.back() - speed.times_s.front()));
  const int steps = static_cast<int>(reach_s / kLagStep_s);
  for (int step = -steps; step <= steps; ++step) {
    shifted.lags_s.push_back(step * kLagStep_s);
    std::vector<double> row;
    for (const double time_s : change.times_s) {
      const double pose_time_s = time_s - shifted.lags_s.back();
      const bool reached =
          pose_time_s >= speed.times_s.front() && pose_time_s <= speed.times_s.back();
      const auto value = reached ? smoothed(speed, pose_time_s, sigma_s) : std::nullopt;
      row.push_back(value.value_or(std::numeric_limits<double>::quiet_NaN()));
    }
    shifted.change.push_back(smooth_change);
    trend.detrend(shifted.change.back(), row);
    shifted.speed.push_back(std::move(row));
  }
  return shifted;
}

std::vector<double> correlations(const ShiftedSpeeds& shifted, const std::vector<int>& weights) {
  std::vector<double> r;
  for (std::size_t i = 0; i < shifted.lags_s.size(); ++i)
    r.push_back(correlation(shifted.change[i], shifted.speed[i], weights));
  return r;
}

std::size_t highest(const std::vector<double>& r) {
  return static_cast<std::size_t>(std::max_element(r.begin(), r.end()) - r.begin());
}

bool is_inside(const std::vector<double>& r, std::size_t i) {
  return i > 0 && i + 1 < r.size() && r[i - 1] != kUnknownCorrelation &&
         r[i + 1] != kUnknownCorrelation;
}

double top_lag_s(const ShiftedSpeeds& shifted, const std::vector<double>& r) {
  const std::size_t i = highest(r);
  if (!is_inside(r, i)) return shifted.lags_s[i];
  const double bend = r[i - 1] - 2.0 * r[i] + r[i + 1];
  const double offset = bend < 0.0 ? 0.5 * (r[i - 1] - r[i + 1]) / bend : 0.0;
  return shifted.lags_s[i] + offset * kLagStep_s;
}

double next_peak(const std::vector<double>& r) {
  const std::size_t top = highest(r);
  std::size_t left = top;
  while (left > 0 && r[left - 1] <= r[left]) --left;
  std::size_t right = top;
  while (right + 1 < r.size() && r[right + 1] <= r[right]) ++right;
  double next = -1.0;
  for (std::size_t i = 0; i < r.size(); ++i)
    if (i < left || i > right) next = std::max(next, r[i]);
  return next;
}

double significance_of(const ShiftedSpeeds& shifted, std::size_t top, double r) {
  std::vector<double> change;
  std::vector<double> speed;
  for (std::size_t i = 0; i < shifted.change[top].size(); ++i) {
    if (std::isnan(shifted.speed[top][i])) continue;
    change.push_back(shifted.change[top][i]);
    speed.push_back(shifted.speed[top][i]);
  }
  // Fisher: atanh(r) has the variance 1 / (n - 3).
  const double n = independent_pairs(change, speed);
  return std::atanh(std::min(r, 1.0 - 1e-9)) * std::sqrt(std::max(n - 3.0, 0.0));
}

std::vector<double> resampled_lags_s(const ShiftedSpeeds& shifted, std::size_t block) {
  std::mt19937_64 random(1);
  const std::size_t pairs = shifted.change.front().size();
  std::vector<double> lags;
  for (int k = 0; k < kResamples; ++k) {
    std::vector<int> weights(pairs, 0);
    for (std::size_t drawn = 0; drawn < pairs; drawn += block) {
      const std::size_t first = random() % (pairs - block + 1);
      for (std::size_t i = first; i < first + block; ++i) ++weights[i];
    }
    const std::vector<double> r = correlations(shifted, weights);
    if (r[highest(r)] != kUnknownCorrelation) lags.push_back(top_lag_s(shifted, r));
  }
  return lags;
}

}  // namespace usct
