#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace usct {

/// The value of a rank, which counts from 0 and is below the number of values. Here and below there
/// must be one value at least, and none may be NaN.
template <typename Value>
Value value_of_rank(std::vector<Value> values, std::size_t rank) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// The value below which this share of the values lies: that of the nearest rank, so that it is one
/// of them.
template <typename Value>
Value nearest_quantile(std::vector<Value> values, double share) {
  const auto rank = std::lround(share * static_cast<double>(values.size() - 1));
  return value_of_rank(std::move(values), static_cast<std::size_t>(rank));
}

/// The middle value, or the mean of the two in the middle.
inline double median(const std::vector<double>& values) {
  const std::size_t half = values.size() / 2;
  const double upper = value_of_rank(values, half);
  if (values.size() % 2 == 1) return upper;
  return 0.5 * (upper + value_of_rank(values, half - 1));
}

}  // namespace usct
