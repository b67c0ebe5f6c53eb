#include "similarity/lattice_ct.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace usct {
namespace {

/// Sums of value, gradient and their products over squares or cubes of kBlockEdge points that begin
/// at each point of a slice; undefined where they do not lie within the lattice.
enum Sum { kValue, kGradient, kValueSquared, kBoth, kGradientSquared, kSums };
using SliceSums = std::array<std::vector<float>, kSums>;

void sum_edge(const std::vector<float>& from, std::size_t step, std::vector<float>& to) {
  static_assert(kBlockEdge == 4, "four numbers are added");
  const std::size_t count = from.size() - std::min(from.size(), (kBlockEdge - 1) * step);
  for (std::size_t i = 0; i < count; ++i)
    to[i] = (from[i] + from[i + step]) + (from[i + 2 * step] + from[i + 3 * step]);
}

/// Sums over squares, slice by slice, so that all that is read and written stays in the cache.
class SquareSums {
 public:
  explicit SquareSums(const LatticeCt& ct)
      : ct_(ct), row_(static_cast<std::size_t>(ct.size.x())), slice_(ct.place({0, 0, 1})) {
    for (std::vector<float>& points : points_) points.resize(slice_);
    rows_.resize(slice_);
  }

  void of_slice(std::size_t k, SliceSums& squares) {
    for (std::size_t i = 0; i < slice_; ++i) {
      const auto v = static_cast<float>(LatticeCt::number(ct_.value[k * slice_ + i]));
      const auto g = static_cast<float>(LatticeCt::number(ct_.gradient[k * slice_ + i]));
      points_[kValue][i] = v;
      points_[kGradient][i] = g;
      points_[kValueSquared][i] = v * v;
      points_[kBoth][i] = v * g;
      points_[kGradientSquared][i] = g * g;
    }
    for (std::size_t sum = 0; sum < kSums; ++sum) {
      squares[sum].resize(slice_);
      sum_edge(points_[sum], 1, rows_);
      sum_edge(rows_, row_, squares[sum]);
    }
  }

 private:
  const LatticeCt& ct_;
  const std::size_t row_, slice_;
  SliceSums points_;
  std::vector<float> rows_;
};

/// Means over cubes, by the sums over squares in as many slices.
void add_slices(const std::array<SliceSums, kBlockEdge>& squares, std::size_t sum,
                std::vector<float>& means) {
  const std::size_t count = squares[0][sum].size();
  means.resize(count);
  const float* const a = squares[0][sum].data();
  const float* const b = squares[1][sum].data();
  const float* const c = squares[2][sum].data();
  const float* const d = squares[3][sum].data();
  float* const mean = means.data();
  constexpr float kShare = 1.0F / (kBlockEdge * kBlockEdge * kBlockEdge);
  for (std::size_t i = 0; i < count; ++i) mean[i] = kShare * ((a[i] + b[i]) + (c[i] + d[i]));
}

struct Ridges {
  float value, gradient;
};

void invert(const SliceSums& means, const Ridges& ridges, float* inverse_vv, float* inverse_vg,
            float* inverse_gg) {
  const float* const v = means[kValue].data();
  const float* const g = means[kGradient].data();
  const float* const square_v = means[kValueSquared].data();
  const float* const both = means[kBoth].data();
  const float* const square_g = means[kGradientSquared].data();
  for (std::size_t i = 0; i < means[kValue].size(); ++i) {
    // Rounding must not make a variance negative.
    const float vv = std::max(square_v[i] - v[i] * v[i], 0.0F) + ridges.value;
    const float gg = std::max(square_g[i] - g[i] * g[i], 0.0F) + ridges.gradient;
    const float vg = both[i] - v[i] * g[i];
    const float scale = 1.0F / std::max(vv * gg - vg * vg, 1e-3F * vv * gg);
    inverse_vv[i] = gg * scale;
    inverse_vg[i] = -vg * scale;
    inverse_gg[i] = vv * scale;
  }
}

float squared(double number) { return static_cast<float>(number * number); }

}  // namespace

LatticeCt::LatticeCt(const Eigen::Vector3i& points)
    : size(points),
      value(static_cast<std::size_t>(points.prod()) + kBlockLanes),
      gradient(value.size()) {}

void LatticeCt::invert_covariances(float value_ridge, float gradient_ridge) {
  for (std::vector<float>* inverse : {&inverse_vv, &inverse_vg, &inverse_gg})
    inverse->resize(value.size());
  const std::size_t slice = place({0, 0, 1});
  SquareSums sums(*this);
  std::array<SliceSums, kBlockEdge> squares;  // of the last slices, in turn
  SliceSums means;
  for (std::size_t k = 0; k < static_cast<std::size_t>(size.z()); ++k) {
    sums.of_slice(k, squares[k % kBlockEdge]);
    if (k + 1 < kBlockEdge) continue;
    for (std::size_t sum = 0; sum < kSums; ++sum) add_slices(squares, sum, means[sum]);
    const std::size_t begin = (k + 1 - kBlockEdge) * slice;
    invert(means, {value_ridge, gradient_ridge}, &inverse_vv[begin], &inverse_vg[begin],
           &inverse_gg[begin]);
  }
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
  const double parts_of_hu = LatticeCt::kPartsOfStep / ct.step_hu();
  lattice.invert_covariances(squared(ridge_hu * parts_of_hu),
                             squared(ridge_hu_per_mm * parts_of_hu / packed.step_per_mm));
  return lattice;
}

void sample_row_scalar(const LatticeRow& row, int count, std::uint32_t* value,
                       std::uint32_t* gradient) {
  const auto parts = [](float steps) {
    return static_cast<std::uint32_t>(std::lround(LatticeCt::kPartsOfStep * steps));
  };
  const auto byte = [](std::uint32_t word, int at) {
    return static_cast<float>(word >> (8 * at) & 0xFFU);
  };
  const auto sample = [&](int i, std::uint32_t& v, std::uint32_t& g) {
    const Eigen::Array3f index = row.first + static_cast<float>(i) * row.step;
    v = parts(row.background);
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
    v = parts(interpolated(0));
    g = parts(interpolated(2));
  };
  for (int i = 0; i < count; ++i) {
    std::uint32_t next_value = 0;
    std::uint32_t next_gradient = 0;
    sample(i, value[i], gradient[i]);
    sample(i + 1, next_value, next_gradient);
    value[i] |= next_value << 16;
    gradient[i] |= next_gradient << 16;
  }
}

}  // namespace usct
