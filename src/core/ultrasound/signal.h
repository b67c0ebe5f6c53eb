#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace usct {

/// A quantity over time, sampled at any intervals.
struct Signal {
  /// Rising times.
  std::vector<double> times_s;
  /// One value per time.
  std::vector<double> values;

  void add(double time_s, double value) {
    times_s.push_back(time_s);
    values.push_back(value);
  }
  std::size_t size() const { return values.size(); }
};

/// Mean and standard deviation (of the population, not corrected for the sample's size).
struct Moments {
  double mean = 0.0;
  double deviation = 0.0;
};

Moments moments(const std::vector<double>& values);

/// Limits the values to those between the quantiles `share` and 1 - `share`.
void clip(Signal& signal, double share);

/// Divides the values by their mean, which must be > 0.
void normalise(Signal& signal);

/// The mean under a Gaussian window around a time, cut off at three standard deviations; empty
/// where the window holds no value.
std::optional<double> smoothed(const Signal& signal, double time_s, double sigma_s);

}  // namespace usct
