#include "us_ct_registration/ultrasound/image_sweep.h"

#include <cmath>
#include <cstdlib>

#include "ultrasound/nanoseconds.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

std::string seconds_text(std::int64_t nanoseconds) {
  return std::to_string(seconds_from(nanoseconds)) + " s";
}

}  // namespace

bool ImageSweep::repeats_last(const std::vector<std::uint8_t>& brightness) const {
  if (images_.empty()) return false;
  const std::vector<std::uint8_t>& last = *images_.back().brightness;
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < last.size(); ++i)
    sum += static_cast<std::uint64_t>(std::abs(int{last[i]} - int{brightness[i]}));
  return static_cast<double>(sum) <= options_.repeat_tolerance * static_cast<double>(last.size());
}

void ImageSweep::add(std::int64_t stamp_ns, std::vector<std::uint8_t> brightness) {
  if (!images_.empty()) {
    const std::int64_t step_ns = stamp_ns - images_.back().stamp_ns;
    if (step_ns < 0)
      throw InputError(name(), "the stamp of image " + std::to_string(images_.size()) + " is " +
                                   seconds_text(-step_ns) + " before that of the image before");
    if (seconds_from(step_ns) > options_.longest_pause_s)
      throw InputError(name(), "no image for " + seconds_text(step_ns) + " after image " +
                                   std::to_string(images_.size() - 1) + ", at most " +
                                   std::to_string(options_.longest_pause_s) +
                                   " s are allowed (sweep_pause)");
    if (step_ns == 0) {
      ++same_stamp_;
      return;
    }
  }
  if (images_.size() >= static_cast<std::size_t>(options_.max_frames))
    throw InputError(
        name(), "it has more than " + std::to_string(options_.max_frames) + " images (max_frames)");
  if (repeats_last(brightness)) {
    images_.push_back({stamp_ns, images_.back().brightness});
    return;
  }
  bytes_ += brightness.size();
  if (bytes_ > options_.max_bytes)
    throw InputError(name(), "it is larger than " + std::to_string(options_.max_bytes) +
                                 " bytes (max_volume_mb)");
  ++distinct_;
  images_.push_back(
      {stamp_ns, std::make_shared<const std::vector<std::uint8_t>>(std::move(brightness))});
}

std::optional<LagEstimate> better_lag(const std::optional<LagEstimate>& earlier,
                                      const LagEstimate& later) {
  if (!later.determined) return earlier;
  if (!earlier || !earlier->determined) return later;
  // Estimates have steps of this size before they are interpolated.
  constexpr double kStep_s = 0.02;
  const double apart_s = std::abs(later.lag_s - earlier->lag_s);
  const double error_s = std::hypot(later.standard_error_s, earlier->standard_error_s);
  const bool contradict = apart_s > 3.0 * error_s + kStep_s;
  return contradict || later.standard_error_s < earlier->standard_error_s ? later : *earlier;
}

}  // namespace usct
