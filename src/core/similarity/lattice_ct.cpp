#include "similarity/lattice_ct.h"

#include <algorithm>
#include <cmath>

namespace usct {
namespace {

float squared(double number) { return static_cast<float>(number * number); }

/// Calls use(point) for all points of a lattice.
template <typename Use>
void for_points(const Eigen::Vector3i& size, const Use& use) {
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) use(Eigen::Vector3i(i, j, k));
}

}  // namespace

LatticeCt::LatticeCt(const Eigen::Vector3i& points)
    : size(points),
      value(points.cast<std::size_t>().prod() + kBeyondPoints),
      gradient(value.size()) {}

void invert_covariances_scalar(LatticeCt& ct, const Ridges& ridges) {
  for (LargeVector<float>* inverse : {&ct.inverse_vv, &ct.inverse_vg, &ct.inverse_gg})
    inverse->resize(ct.value.size());
  constexpr float kShare = 1.0F / (kBlockEdge * kBlockEdge * kBlockEdge);
  const Eigen::Vector3i cubes = ct.size - Eigen::Vector3i::Constant(kBlockEdge - 1);
  for_points(cubes, [&](const Eigen::Vector3i& first) {
    int v = 0, g = 0, square_v = 0, both = 0, square_g = 0;
    for_points(Eigen::Vector3i::Constant(kBlockEdge), [&](const Eigen::Vector3i& further) {
      const std::size_t at = ct.place(first + further);
      const int value = LatticeCt::byte(ct.value[at]);
      const int gradient = LatticeCt::byte(ct.gradient[at]);
      v += value;
      g += gradient;
      square_v += value * value;
      both += value * gradient;
      square_g += gradient * gradient;
    });
    const auto covariance = [&](int product, int a, int b) {
      return kShare * static_cast<float>(product) -
             kShare * static_cast<float>(a) * (kShare * static_cast<float>(b));
    };
    const float vv = covariance(square_v, v, v) + ridges.value;
    const float gg = covariance(square_g, g, g) + ridges.gradient;
    const float vg = covariance(both, v, g);
    const float scale = 1.0F / std::max(vv * gg - vg * vg, kLeastDeterminant * vv * gg);
    const std::size_t at = ct.place(first);
    ct.inverse_vv[at] = gg * scale;
    ct.inverse_vg[at] = -vg * scale;
    ct.inverse_gg[at] = vv * scale;
  });
}

LatticeCt sampled_lattice(const PackedCt& ct, const Eigen::Affine3d& T_index_lattice,
                          const Eigen::Vector3i& size, double ridge_hu, double ridge_hu_per_mm) {
  LatticeCt lattice(size);
  const PackedGradient packed = ct.gradient();
  LatticeRow row{packed.words,
                 (ct.grid().size.array() - 1).cast<float>(),
                 static_cast<int>(ct.stride_j()),
                 static_cast<int>(ct.stride_k()),
                 static_cast<float>(ct.background()),
                 {},
                 T_index_lattice.linear().col(0).cast<float>()};
  // Rows go beyond their ends, so that the next one must come later.
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j) {
      const std::size_t begin = lattice.place({0, j, k});
      row.first = (T_index_lattice * Eigen::Vector3d(0.0, j, k)).cast<float>();
      sample_row_simd(row, size.x(), &lattice.value[begin], &lattice.gradient[begin]);
    }
  invert_covariances_simd(lattice, {squared(ridge_hu / ct.step_hu()),
                                    squared(ridge_hu_per_mm / ct.step_hu() / packed.step_per_mm)});
  return lattice;
}

void sample_row_scalar(const LatticeRow& row, int count, std::uint32_t* value,
                       std::uint32_t* gradient) {
  const auto rounded = [](float steps) { return static_cast<std::uint32_t>(std::lround(steps)); };
  const auto byte = [](std::uint32_t word, int at) {
    return static_cast<float>(word >> (8 * at) & 0xFFU);
  };
  const auto sample = [&](int i, std::uint32_t& v, std::uint32_t& g) {
    const Eigen::Array3f index = row.first + static_cast<float>(i) * row.step;
    v = rounded(row.background);
    g = 0;
    if (!((index >= 0.0F).all() && (index < row.cells).all())) return;
    const Eigen::Array3i cell = index.cast<int>();
    const Eigen::Array3f t = index - cell.cast<float>();
    const std::uint32_t* low = row.words + cell.x() + cell.y() * row.stride_j +
                               static_cast<std::ptrdiff_t>(cell.z()) * row.stride_k;
    const std::uint32_t* high = low + row.stride_k;
    const auto interpolated = [&](int first_byte) {
      float along_j[2];
      for (int j = 0; j < 2; ++j) {
        const int at = first_byte + j;
        const float below = byte(low[0], at) + t.x() * (byte(low[1], at) - byte(low[0], at));
        const float above = byte(high[0], at) + t.x() * (byte(high[1], at) - byte(high[0], at));
        along_j[j] = below + t.z() * (above - below);
      }
      return along_j[0] + t.y() * (along_j[1] - along_j[0]);
    };
    v = rounded(interpolated(0));
    g = rounded(interpolated(2));
  };
  for (int i = 0; i < count; ++i) sample(i, value[i], gradient[i]);
  for (std::uint32_t* const words : {value, gradient})
    for (int i = 0; i < count; ++i)
      for (int next = 1; next < kBlockEdge && i + next < count; ++next)
        words[i] |= words[i + next] << (8 * next);
}

}  // namespace usct
