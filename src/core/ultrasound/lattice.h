#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "us_ct_registration/geometry/monotonic_table.h"

/// Interpolation between the samples of ultrasound before scan conversion. It has no `Volume`,
/// since its axes are not lengths.
namespace usct {

/// Whether a continuous index lies within the recorded range, which extends half a step beyond the
/// outermost indices.
inline bool is_recorded(double index, int count) { return index >= -0.5 && index < count - 0.5; }

/// The two neighbours of a continuous index in the recorded range along one axis; beyond the
/// outermost indices the edge value is repeated.
struct Neighbours {
  int lower;
  int upper;
  float weight;  // of `upper`

  static Neighbours linear(double index, int count) {
    const double clamped = std::min(std::max(index, 0.0), static_cast<double>(count - 1));
    const int lower = static_cast<int>(clamped);  // not negative, so truncation equals floor
    const auto weight = static_cast<float>(clamped - static_cast<double>(lower));
    return {lower, weight > 0.0F ? lower + 1 : lower, weight};
  }
  static Neighbours nearest(double index, int count) {
    // NOLINTNEXTLINE(bugprone-incorrect-roundings): not negative, and rounding calls cost more.
    const int n = std::clamp(static_cast<int>(index + 0.5), 0, count - 1);
    return {n, n, 0.0F};
  }
};

/// The indices of a table of angles or positions at which a fan can reach farthest along an axis:
/// all entries, half a step beyond either end, and the axial direction.
inline std::vector<double> bounding_indices(const std::vector<double>& table) {
  const double end = static_cast<double>(table.size()) - 0.5;
  std::vector<double> indices{-0.5, end};
  for (std::size_t i = 0; i < table.size(); ++i) indices.push_back(static_cast<double>(i));
  const double ahead = MonotonicTable(table, "table", "table").index_of(0.0);
  if (ahead > -0.5 && ahead < end) indices.push_back(ahead);
  return indices;
}

/// Rounds a brightness in [0, 255] to the nearest grey value.
inline std::uint8_t grey(float brightness) {
  // NOLINTNEXTLINE(bugprone-incorrect-roundings): not negative, and rounding calls cost more.
  return static_cast<std::uint8_t>(brightness + 0.5F);
}

inline float mix(float a, float b, float weight_of_b) { return a + weight_of_b * (b - a); }

}  // namespace usct
