#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <random>

#include "us_ct_registration/error.h"
#include "us_ct_registration/ultrasound/image_lag.h"

namespace usct {
namespace {

constexpr double kLargestShift_s = 1.5;
constexpr double kShiftStep_s = 0.02;
constexpr double kSmoothing_s = 0.1;
/// What changes more slowly than this is taken out, as long as it is slower than the smoothing.
constexpr double kTrend_s = 1.0;
constexpr double kBlock_s = 1.0;
constexpr int kResamples = 200;
constexpr int kFewestPairs = 20;
constexpr double kClippedShare = 0.05;
constexpr double kLeastSpeedVariation = 0.1;
constexpr double kLeastSignificance = 3.0;
constexpr double kWidestInterval_s = 0.5;
/// A pair of frames further apart than this many usual intervals has a missing frame between.
constexpr double kGapIntervals = 1.5;
constexpr double kUnknown = -2.0;  // below every correlation

/// Values at times, in order of time.
struct Signal {
  std::vector<double> times_s;
  std::vector<double> values;

  void add(double time_s, double value) {
    times_s.push_back(time_s);
    values.push_back(value);
  }
  std::size_t size() const { return values.size(); }
};

double quantile(std::vector<double> values, double share) {
  const auto at = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// A flash, a change of gain or a jump of the tracker must not decide.
void clip(Signal& signal) {
  const double low = quantile(signal.values, kClippedShare);
  const double high = quantile(signal.values, 1.0 - kClippedShare);
  for (double& value : signal.values) value = std::clamp(value, low, high);
}

/// Mean with Gaussian weights around a time; empty where the signal has nothing nearby.
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

/// Without what changes so slowly that it says little of the lag: the anatomy that the sweep passes
/// changes the images as well.
std::optional<double> detrended(const Signal& signal, double time_s, double sigma_s) {
  const std::optional<double> value = smoothed(signal, time_s, sigma_s);
  if (!value) return value;
  return *value - *smoothed(signal, time_s, std::max(kTrend_s, 3.0 * sigma_s));
}

struct Moments {
  double mean = 0.0;
  double deviation = 0.0;
};

Moments moments(const std::vector<double>& values) {
  Moments m;
  for (const double value : values) m.mean += value / static_cast<double>(values.size());
  for (const double value : values)
    m.deviation += (value - m.mean) * (value - m.mean) / static_cast<double>(values.size());
  m.deviation = std::sqrt(m.deviation);
  return m;
}

/// Image change at the middle of each usable pair of frames, and the probe's speed there had the
/// images been late by each of the shifts.
struct Shifted {
  std::vector<double> shifts_s;
  std::vector<double> change;
  /// Per shift and pair; NaN where the poses do not reach.
  std::vector<std::vector<double>> speed;
};

/// Over pairs with integer weights; kUnknown where fewer than half of them have a speed.
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
  if (n < 0.5 * all || n < 3.0) return kUnknown;
  const double variance_a = saa - sa * sa / n;
  const double variance_b = sbb - sb * sb / n;
  // Values are of the order of one: below this is rounding.
  constexpr double kRounding = 1e-12;
  if (variance_a < kRounding || variance_b < kRounding) return kUnknown;
  return (sab - sa * sb / n) / std::sqrt(variance_a * variance_b);
}

std::vector<double> correlations(const Shifted& shifted, const std::vector<int>& weights) {
  std::vector<double> r;
  for (const std::vector<double>& speed : shifted.speed)
    r.push_back(correlation(shifted.change, speed, weights));
  return r;
}

std::size_t highest(const std::vector<double>& r) {
  return static_cast<std::size_t>(std::max_element(r.begin(), r.end()) - r.begin());
}

bool is_inside(const std::vector<double>& r, std::size_t i) {
  return i > 0 && i + 1 < r.size() && r[i - 1] != kUnknown && r[i + 1] != kUnknown;
}

/// The top of the parabola through the highest correlation and its neighbours.
double top_shift_s(const Shifted& shifted, const std::vector<double>& r) {
  const std::size_t i = highest(r);
  if (!is_inside(r, i)) return shifted.shifts_s[i];
  const double bend = r[i - 1] - 2.0 * r[i] + r[i + 1];
  const double offset = bend < 0.0 ? 0.5 * (r[i - 1] - r[i + 1]) / bend : 0.0;
  return shifted.shifts_s[i] + offset * kShiftStep_s;
}

/// The highest correlation that is not on the slopes of the highest peak.
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

double autocorrelation(const std::vector<double>& values, const Moments& m, std::size_t lag) {
  double sum = 0.0;
  for (std::size_t i = 0; i + lag < values.size(); ++i)
    sum += (values[i] - m.mean) * (values[i + lag] - m.mean);
  return sum / (static_cast<double>(values.size()) * m.deviation * m.deviation);
}

/// How many independent pairs of values two smooth signals amount to (Bartlett).
double independent_pairs(const std::vector<double>& a, const std::vector<double>& b) {
  const Moments ma = moments(a);
  const Moments mb = moments(b);
  double spread = 1.0;
  for (std::size_t lag = 1; lag < a.size() / 2; ++lag)
    spread += 2.0 * autocorrelation(a, ma, lag) * autocorrelation(b, mb, lag);
  return static_cast<double>(a.size()) / std::max(1.0, spread);
}

double significance_of(const Shifted& shifted, std::size_t top, double r) {
  std::vector<double> change;
  std::vector<double> speed;
  for (std::size_t i = 0; i < shifted.change.size(); ++i) {
    if (std::isnan(shifted.speed[top][i])) continue;
    change.push_back(shifted.change[i]);
    speed.push_back(shifted.speed[top][i]);
  }
  // Fisher: atanh(r) has the variance 1 / (n - 3).
  const double n = independent_pairs(change, speed);
  return std::atanh(std::min(r, 1.0 - 1e-9)) * std::sqrt(std::max(n - 3.0, 0.0));
}

/// The lag of sweeps put together from random blocks of this one.
std::vector<double> resampled_lags_s(const Shifted& shifted, std::size_t block) {
  std::mt19937_64 random(1);
  const std::size_t pairs = shifted.change.size();
  std::vector<double> lags;
  for (int k = 0; k < kResamples; ++k) {
    std::vector<int> weights(pairs, 0);
    for (std::size_t drawn = 0; drawn < pairs; drawn += block) {
      const std::size_t first = random() % (pairs - block + 1);
      for (std::size_t i = first; i < first + block; ++i) ++weights[i];
    }
    const std::vector<double> r = correlations(shifted, weights);
    if (r[highest(r)] != kUnknown) lags.push_back(top_shift_s(shifted, r));
  }
  return lags;
}

Shifted shift(const Signal& change, const Signal& speed, double sigma_s) {
  Shifted shifted;
  for (const double time_s : change.times_s)
    shifted.change.push_back(*detrended(change, time_s, sigma_s));
  const double reach_s =
      std::min(kLargestShift_s, 0.5 * (speed.times_s.back() - speed.times_s.front()));
  const int steps = static_cast<int>(reach_s / kShiftStep_s);
  for (int step = -steps; step <= steps; ++step) {
    shifted.shifts_s.push_back(step * kShiftStep_s);
    std::vector<double> row;
    for (const double time_s : change.times_s) {
      const double pose_time_s = time_s - shifted.shifts_s.back();
      const bool reached =
          pose_time_s >= speed.times_s.front() && pose_time_s <= speed.times_s.back();
      const auto value = reached ? detrended(speed, pose_time_s, sigma_s) : std::nullopt;
      row.push_back(value.value_or(std::numeric_limits<double>::quiet_NaN()));
    }
    shifted.speed.push_back(std::move(row));
  }
  return shifted;
}

/// In units of the mean, so that thresholds have no unit. The mean must be > 0.
void normalise(Signal& signal) {
  const double mean = moments(signal.values).mean;
  for (double& value : signal.values) value /= mean;
}

std::string text(const char* format, double value) {
  char buffer[160];
  std::snprintf(buffer, sizeof(buffer), format, value);
  return buffer;
}

/// Why the estimate is not to be relied upon; empty if it is.
std::string doubt(const LagEstimate& estimate, bool inside) {
  if (!(estimate.significance >= kLeastSignificance))
    return text("image change and probe speed correlate by %.2f", estimate.correlation) +
           text(", %.1f standard deviations above chance, must be >= 3", estimate.significance);
  if (!inside)
    return text("the correlation still rises at the largest shift, %.2f s", estimate.lag_s);
  const double width = estimate.interval_s.second - estimate.interval_s.first;
  if (width > kWidestInterval_s)
    return text("the lag is uncertain: its 95 %% interval is %.2f s wide, must be <= 0.5 s", width);
  return {};
}

void estimate_from(Signal change, Signal speed, double interval_s, LagEstimate& estimate) {
  const double sigma_s = std::max(kSmoothing_s, interval_s);
  clip(change);
  clip(speed);
  const double mean_speed = moments(speed.values).mean;
  if (!(mean_speed > 0.0)) {
    estimate.message = "the probe does not move";
    return;
  }
  normalise(speed);
  normalise(change);
  std::vector<double> smooth_speed;
  for (const double time_s : speed.times_s)
    smooth_speed.push_back(*smoothed(speed, time_s, sigma_s));
  estimate.speed_variation = moments(smooth_speed).deviation;
  if (estimate.speed_variation < kLeastSpeedVariation) {
    estimate.message = text("the probe's speed varies by only %.1f %%, must vary by 10 %% or more",
                            100.0 * estimate.speed_variation);
    return;
  }
  const Shifted shifted = shift(change, speed, sigma_s);
  const std::vector<double> r = correlations(shifted, std::vector<int>(change.size(), 1));
  const std::size_t top = highest(r);
  if (r[top] == kUnknown) {
    estimate.message = "image change or probe speed does not vary where the two meet";
    return;
  }
  estimate.lag_s = top_shift_s(shifted, r);
  estimate.correlation = r[top];
  estimate.next_correlation = next_peak(r);
  estimate.significance = significance_of(shifted, top, r[top]);
  const auto block = static_cast<std::size_t>(std::max(1.0, kBlock_s / interval_s));
  const std::vector<double> lags_s = resampled_lags_s(shifted, std::min(block, change.size() / 2));
  if (!lags_s.empty()) {
    estimate.standard_error_s = moments(lags_s).deviation;
    estimate.interval_s = {quantile(lags_s, 0.025), quantile(lags_s, 0.975)};
  }
  estimate.message = doubt(estimate, is_inside(r, top));
  estimate.determined = estimate.message.empty();
}

/// `travel_mm[i]` and `change[i]` from frame i to i + 1.
LagEstimate estimate_from_frames(const std::vector<double>& times_s,
                                 const std::vector<double>& travel_mm,
                                 const std::vector<double>& change) {
  LagEstimate estimate;
  std::vector<double> intervals_s;
  for (std::size_t i = 0; i + 1 < times_s.size(); ++i)
    if (times_s[i + 1] > times_s[i]) intervals_s.push_back(times_s[i + 1] - times_s[i]);
  const double usual_s = intervals_s.empty() ? 0.0 : quantile(intervals_s, 0.5);
  Signal image_change;
  Signal speed;
  for (std::size_t i = 0; i + 1 < times_s.size(); ++i) {
    const double interval_s = times_s[i + 1] - times_s[i];
    const double middle_s = 0.5 * (times_s[i] + times_s[i + 1]);
    if (interval_s > 0.0) speed.add(middle_s, travel_mm[i] / interval_s);
    if (change[i] == 0.0) ++estimate.repeated_images;
    // After a repeated image the next one shows the change of two intervals.
    const bool repeated = change[i] == 0.0 || (i > 0 && change[i - 1] == 0.0);
    if (!repeated && interval_s > 0.0 && interval_s <= kGapIntervals * usual_s)
      image_change.add(middle_s, change[i]);
  }
  estimate.pairs = static_cast<int>(image_change.size());
  if (estimate.pairs < kFewestPairs) {
    estimate.message = "has " + std::to_string(estimate.pairs) +
                       " usable pairs of consecutive frames, must have 20 or more";
    return estimate;
  }
  estimate_from(std::move(image_change), std::move(speed), usual_s, estimate);
  return estimate;
}

/// Mean absolute difference of consecutive images, over the pixels of `shown` (all if empty).
std::vector<double> image_changes(const std::vector<std::uint8_t>& images, std::size_t pixels,
                                  const std::vector<std::uint8_t>& shown) {
  std::vector<double> changes;
  for (std::size_t first = pixels; first + pixels <= images.size(); first += pixels) {
    const std::uint8_t* after = images.data() + first;
    const std::uint8_t* before = after - pixels;
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < pixels; ++i)
      if (shown.empty() || shown[i] != 0)
        sum += static_cast<std::uint64_t>(std::abs(int{after[i]} - int{before[i]}));
    changes.push_back(static_cast<double>(sum) / static_cast<double>(pixels));
  }
  return changes;
}

/// Root mean square way of points of the image from each frame to the next; this counts turns too.
template <typename Transform>
std::vector<double> travels_mm(const std::vector<Transform>& T_us_image,
                               const std::vector<Eigen::Vector3d>& points) {
  std::vector<double> travels;
  for (std::size_t i = 0; i + 1 < T_us_image.size(); ++i) {
    double sum = 0.0;
    for (const Eigen::Vector3d& p : points)
      sum += (T_us_image[i + 1] * p - T_us_image[i] * p).squaredNorm();
    travels.push_back(std::sqrt(sum / static_cast<double>(points.size())));
  }
  return travels;
}

}  // namespace

LagEstimate estimate_lag(const PreScanVolume& volume) {
  volume.validate("lag");
  const auto* sweep = std::get_if<TrackedSweep>(&volume.geometry.motion);
  if (sweep == nullptr)
    throw InputError("lag", "the sweep is motorised: it has no poses that images could lag");
  if (sweep->frame_times_s.empty()) throw InputError("lag", "the frames have no times");
  std::vector<Eigen::Vector3d> corners;
  for (const int line : {0, volume.geometry.lines() - 1})
    for (const int sample : {0, volume.geometry.samples() - 1}) {
      const Line beam = line_in_frame(volume.geometry.array, line);
      corners.push_back(beam.origin_mm + volume.geometry.axial.depth_mm(sample) * beam.direction);
    }
  return estimate_from_frames(sweep->frame_times_s, travels_mm(sweep->T_us_frame, corners),
                              image_changes(volume.voxels, volume.offset(0, 0, 1), {}));
}

LagEstimate estimate_lag(const TrackedImages& images) {
  images.validate("lag");
  if (images.times_s.empty()) throw InputError("lag", "the images have no times");
  std::vector<Eigen::Vector3d> corners;
  for (const int column : {0, images.width - 1})
    for (const int row : {0, images.height - 1}) corners.emplace_back(column, row, 0.0);
  return estimate_from_frames(
      images.times_s, travels_mm(images.T_us_pixel, corners),
      image_changes(images.pixels, images.pixels.size() / images.times_s.size(), images.shown));
}

}  // namespace usct
