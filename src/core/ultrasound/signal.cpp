#include "ultrasound/signal.h"

#include <algorithm>
#include <cmath>

#include "order_statistics.h"

namespace usct {

Moments moments(const std::vector<double>& values) {
  Moments m;
  for (const double value : values) m.mean += value / static_cast<double>(values.size());
  for (const double value : values)
    m.deviation += (value - m.mean) * (value - m.mean) / static_cast<double>(values.size());
  m.deviation = std::sqrt(m.deviation);
  return m;
}

void clip(Signal& signal, double share) {
  const double low = nearest_quantile(signal.values, share);
  const double high = nearest_quantile(signal.values, 1.0 - share);
  for (double& value : signal.values) value = std::clamp(value, low, high);
}

void normalise(Signal& signal) {
  const double mean = moments(signal.values).mean;
  for (double& value : signal.values) value /= mean;
}

std::optional<double> smoothed(const Signal& signal, double time_s, double sigma_s) {
  const auto first =
      std::lower_bound(signal.times_s.begin(), signal.times_s.end(), time_s - 3.0 * sigma_s);
  double sum = 0.0;
  double weights = 0.0;
  for (auto t = first; t != signal.times_s.end() && *t <= time_s + 3.0 * sigma_s; ++t) {
    const double distance = (*t - time_s) / sigma_s;
    const double weight = std::exp(-0.5 * distance * distance);
    sum += weight * signal.values[static_cast<std::size_t>(t - signal.times_s.begin())];
    weights += weight;
  }
  if (weights == 0.0) return std::nullopt;
  return sum / weights;
}

}  // namespace usct
