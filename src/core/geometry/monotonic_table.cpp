#include "us_ct_registration/geometry/monotonic_table.h"

#include <algorithm>
#include <cmath>

#include "us_ct_registration/error.h"

namespace usct {
namespace {

/// The segment [i, i + 1] of a table that holds a continuous index; beyond the ends, the outermost
/// segment.
std::size_t segment_of(const std::vector<double>& values, double index) {
  const auto last = static_cast<double>(values.size() - 2);
  // The argument is not negative, so truncation equals floor. The order of the arguments of min and
  // max sends a NaN to a valid segment too, and the interpolated value is then NaN.
  return static_cast<std::size_t>(std::max(0.0, std::min(last, index)));
}

}  // namespace

void require_monotonic(const std::vector<double>& values, const std::string& source,
                       const std::string& field) {
  const auto fail = [&](const std::string& violation) {
    throw InputError(source, "'" + field + "' " + violation);
  };
  if (values.size() < 2)
    fail("has " + std::to_string(values.size()) + " entries, must have at least 2");
  const bool rising = values[1] > values[0];
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::string entry = "entry " + std::to_string(i) + " is " + std::to_string(values[i]);
    if (!std::isfinite(values[i])) fail(entry + ", must be finite");
    if (i > 0 && (rising ? values[i] <= values[i - 1] : values[i] >= values[i - 1]))
      fail(entry + " after " + std::to_string(values[i - 1]) +
           ", must be strictly rising or strictly falling");
  }
}

MonotonicTable::MonotonicTable(std::vector<double> values, const std::string& source,
                               const std::string& field)
    : values_(std::move(values)) {
  require_monotonic(values_, source, field);
  rising_ = values_[1] > values_[0];
  mean_slope_inverse_ =
      static_cast<double>(values_.size() - 1) / (values_.back() - values_.front());
}

double MonotonicTable::at(double index) const { return interpolate_table(values_, index); }

double MonotonicTable::index_of(double value) const {
  // The search begins at the segment that an evenly spaced table would have, and steps from there
  // as far as the table is uneven. The outermost segments continue to infinity.
  const double guess = (value - values_.front()) * mean_slope_inverse_;
  std::size_t i = segment_of(values_, guess);
  while (i > 0 && (value < values_[i]) == rising_) --i;
  while (i + 2 < values_.size() && (value >= values_[i + 1]) == rising_) ++i;
  return static_cast<double>(i) + (value - values_[i]) / (values_[i + 1] - values_[i]);
}

double interpolate_table(const std::vector<double>& values, double index) {
  const std::size_t i = segment_of(values, index);
  return values[i] + (index - static_cast<double>(i)) * (values[i + 1] - values[i]);
}

std::vector<double> centred_table(int count, double pitch) {
  std::vector<double> values(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i)
    values[static_cast<std::size_t>(i)] = (i - 0.5 * (count - 1)) * pitch;
  return values;
}

}  // namespace usct
