#include <algorithm>
#include <cmath>

#include "ultrasound/lag_correlation.h"
#include "ultrasound/signal.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/ultrasound/image_lag.h"

namespace usct {
namespace {

constexpr double kSmoothing_s = 0.1;
constexpr double kBlock_s = 1.0;
constexpr int kFewestPairs = 20;
/// Share clipped at either end of a signal, so that a flash, a change of gain or a jump of the
/// tracker does not dominate.
constexpr double kClippedShare = 0.05;
constexpr double kLeastSpeedVariation = 0.1;
constexpr double kLeastSignificance = 3.0;
constexpr double kWidestInterval_s = 0.5;
/// A pair of frames further apart than this many usual intervals has a missing frame between.
constexpr double kGapIntervals = 1.5;

/// The reason why the estimate is not reliable; empty if it is.
std::string doubt(const LagEstimate& estimate, bool inside) {
  if (!(estimate.significance >= kLeastSignificance))
    return formatted("image change and probe speed correlate by %.2f", estimate.correlation) +
           formatted(", %.1f standard deviations above chance, must be >= 3",
                     estimate.significance);
  if (!inside)
    return formatted("the correlation still rises at the largest shift, %.2f s", estimate.lag_s);
  const double width = estimate.interval_s.second - estimate.interval_s.first;
  if (width > kWidestInterval_s)
    return formatted("the lag is uncertain: its 95 %% interval is %.2f s wide, must be <= 0.5 s",
                     width);
  return {};
}

void estimate_from(Signal change, Signal speed, double interval_s, LagEstimate& estimate) {
  const double sigma_s = std::max(kSmoothing_s, interval_s);
  clip(change, kClippedShare);
  clip(speed, kClippedShare);
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
    estimate.message =
        formatted("the probe's speed varies by only %.1f %%, must vary by 10 %% or more",
                  100.0 * estimate.speed_variation);
    return;
  }
  const ShiftedSpeeds shifted = shift_speed(change, speed, sigma_s);
  const std::vector<double> r = correlations(shifted, std::vector<int>(change.size(), 1));
  const std::size_t top = highest(r);
  if (r[top] == kUnknownCorrelation) {
    estimate.message = "image change or probe speed does not vary where the two meet";
    return;
  }
  estimate.lag_s = top_lag_s(shifted, r);
  estimate.correlation = r[top];
  estimate.next_correlation = next_peak(r);
  estimate.significance = significance_of(shifted, top, r[top]);
  const auto block = static_cast<std::size_t>(std::max(1.0, kBlock_s / interval_s));
  const std::vector<double> lags_s = resampled_lags_s(shifted, std::min(block, change.size() / 2));
  if (!lags_s.empty()) {
    estimate.standard_error_s = moments(lags_s).deviation;
    estimate.interval_s = {nearest_quantile(lags_s, 0.025), nearest_quantile(lags_s, 0.975)};
  }
  estimate.message = doubt(estimate, is_inside(r, top));
  estimate.determined = estimate.message.empty();
}

/// Estimates the lag; `travel_mm[i]` and `change[i]` are from frame i to i + 1.
LagEstimate estimate_from_frames(const std::vector<double>& times_s,
                                 const std::vector<double>& travel_mm,
                                 const std::vector<double>& change) {
  LagEstimate estimate;
  std::vector<double> intervals_s;
  for (std::size_t i = 0; i + 1 < times_s.size(); ++i)
    if (times_s[i + 1] > times_s[i]) intervals_s.push_back(times_s[i + 1] - times_s[i]);
  const double usual_s = intervals_s.empty() ? 0.0 : nearest_quantile(intervals_s, 0.5);
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

/// Root mean square path of points of the image from each frame to the next, which includes
/// rotation.
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
