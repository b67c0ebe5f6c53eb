#include "us_ct_registration/geometry/monotonic_table.h"

#include <algorithm>
#include <cmath>

#include "us_ct_registration/error.h"

namespace usct {

MonotonicTable::MonotonicTable(std::vector<double> values, const std::string& source,
                               const std::string& field)
    : values_(std::move(values)) {
  const auto fail = [&](const std::string& violation) {
    throw InputError(source, "'" + field + "' " + violation);
  };
  if (values_.size() < 2)
    fail("has " + std::to_string(values_.size()) + " entries, must have at least 2");
  rising_ = values_[1] > values_[0];
  for (std::size_t i = 0; i < values_.size(); ++i) {
    const std::string entry = "entry " + std::to_string(i) + " is " + std::to_string(values_[i]);
    if (!std::isfinite(values_[i])) fail(entry + ", must be finite");
    if (i > 0 && (rising_ ? values_[i] <= values_[i - 1] : values_[i] >= values_[i - 1]))
      fail(entry + " after " + std::to_string(values_[i - 1]) +
           ", must be strictly rising or strictly falling");
  }
}

double MonotonicTable::at(double index) const { return interpolate_table(values_, index); }

double MonotonicTable::index_of(double value) const {
  // The segment whose end is the first inner entry beyond the value; the outermost segments
  // continue to infinity.
  const auto begin = values_.begin() + 1;
  const auto end = values_.end() - 1;
  const auto it = rising_ ? std::upper_bound(begin, end, value)
                          : std::upper_bound(begin, end, value, std::greater<double>());
  const auto i = static_cast<std::size_t>(it - values_.begin()) - 1;
  return static_cast<double>(i) + (value - values_[i]) / (values_[i + 1] - values_[i]);
}

double interpolate_table(const std::vector<double>& values, double index) {
  const auto last = static_cast<double>(values.size() - 2);
  const auto i = static_cast<std::size_t>(std::clamp(std::floor(index), 0.0, last));
  return values[i] + (index - static_cast<double>(i)) * (values[i + 1] - values[i]);
}

std::vector<double> centred_table(int count, double pitch) {
  std::vector<double> values(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i)
    values[static_cast<std::size_t>(i)] = (i - 0.5 * (count - 1)) * pitch;
  return values;
}

}  // namespace usct
