#include <algorithm>

#include "similarity/block_kernel.h"

namespace usct {
namespace {

/// Replaces each number by the sum of kBlockEdge of them, `step` apart; undefined near the end.
void sum_edge(std::vector<float>& values, std::size_t step) {
  float* v = values.data();
  const std::size_t count = values.size() - std::min(values.size(), (kBlockEdge - 1) * step);
  for (std::size_t i = 0; i < count; ++i)
    v[i] = (v[i] + v[i + step]) + (v[i + 2 * step] + v[i + 3 * step]);
}
static_assert(kBlockEdge == 4, "sum_edge adds four numbers");

/// Means over the cubes that begin at each point.
std::vector<float> cube_means(std::vector<float> values, const Eigen::Vector3i& size) {
  const auto row = static_cast<std::size_t>(size.x());
  sum_edge(values, 1);
  sum_edge(values, row);
  sum_edge(values, row * static_cast<std::size_t>(size.y()));
  constexpr float kShare = 1.0F / (kBlockEdge * kBlockEdge * kBlockEdge);
  for (float& value : values) value *= kShare;
  return values;
}

std::vector<float> products(const std::vector<float>& a, const std::vector<float>& b) {
  std::vector<float> result(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) result[i] = a[i] * b[i];
  return result;
}

}  // namespace

void LatticeCt::invert_covariances(float value_ridge, float gradient_ridge) {
  const std::vector<float> v = cube_means(value, size);
  const std::vector<float> g = cube_means(gradient, size);
  inverse_vv = cube_means(products(value, value), size);
  inverse_vg = cube_means(products(value, gradient), size);
  inverse_gg = cube_means(products(gradient, gradient), size);
  for (std::size_t i = 0; i < v.size(); ++i) {
    // Rounding must not make a variance negative.
    const float vv = std::max(inverse_vv[i] - v[i] * v[i], 0.0F) + value_ridge;
    const float gg = std::max(inverse_gg[i] - g[i] * g[i], 0.0F) + gradient_ridge;
    const float vg = inverse_vg[i] - v[i] * g[i];
    const float scale = 1.0F / std::max(vv * gg - vg * vg, 1e-3F * vv * gg);
    inverse_vv[i] = gg * scale;
    inverse_vg[i] = -vg * scale;
    inverse_gg[i] = vv * scale;
  }
}

void block_values_scalar(const BlockMatch& match, float* values) {
  const std::size_t row = whole_vectors(match.translations.x());
  for (int z = 0; z < match.translations.z(); ++z)
    for (int y = 0; y < match.translations.y(); ++y, values += row)
      for (int x = 0; x < match.translations.x(); ++x) {
        const Eigen::Vector3i first = match.first + Eigen::Vector3i(x, y, z);
        const float* ultrasound = match.ultrasound;
        float v = 0.0F;
        float g = 0.0F;
        for (int k = 0; k < kBlockEdge; ++k)
          for (int j = 0; j < kBlockEdge; ++j)
            for (int i = 0; i < kBlockEdge; ++i, ++ultrasound) {
              const std::size_t at = match.ct.place(first + Eigen::Vector3i(i, j, k));
              v += *ultrasound * match.ct.value[at];
              g += *ultrasound * match.ct.gradient[at];
            }
        const std::size_t at = match.ct.place(first);
        const float explained = match.ct.inverse_vv[at] * v * v +
                                2.0F * match.ct.inverse_vg[at] * v * g +
                                match.ct.inverse_gg[at] * g * g;
        values[x] = std::min(explained, match.known);
      }
}

void add_block_scalar(const BlockSum& sum) {
  const std::size_t row = whole_vectors(sum.sums_size.x());
  float* sums = sum.sums;
  for (int z = 0; z < sum.sums_size.z(); ++z)
    for (int y = 0; y < sum.sums_size.y(); ++y, sums += row) {
      const float* values = sum.values + static_cast<std::size_t>(z) * sum.slice +
                            static_cast<std::size_t>(y) * sum.row;
      for (std::size_t x = 0; x < row; ++x) sums[x] += values[x];
    }
}

}  // namespace usct
