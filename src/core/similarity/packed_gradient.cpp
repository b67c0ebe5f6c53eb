// The file is compiled once per instruction set; the machine's best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/packed_gradient.cpp"
#include "similarity/packed_gradient.h"

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "similarity/packed_voxels.h"

#ifndef USCT_SIMILARITY_PACKED_GRADIENT_ROW_
#define USCT_SIMILARITY_PACKED_GRADIENT_ROW_
namespace usct {

/// A row of voxels with the rows beside it. Each has one value more in front and behind.
struct RowNeighbours {
  const std::uint8_t *here, *before_j, *after_j, *before_k, *after_k;
  /// Per axis half the square of a byte's step of the gradient per voxel.
  float weights[3];
};

}  // namespace usct
#endif

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// The root mean square of the magnitudes that the eight cells around a voxel have there: per axis
/// the mean of the squares of both differences.
void gradient_row(const RowNeighbours& row, std::size_t count, std::uint8_t* out) {
  const hn::ScalableTag<float> df;
  const hn::RebindToSigned<decltype(df)> di;
  const hn::Rebind<std::uint8_t, decltype(df)> bytes;
  const auto load = [&](const std::uint8_t* at) HWY_ATTR {
    return hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(bytes, at)));
  };
  // The rows are as long as whole vectors.
  for (std::size_t i = 0; i < count; i += hn::Lanes(df)) {
    const auto here = load(row.here + i);
    const auto squares = [&](float weight, const std::uint8_t* before,
                             const std::uint8_t* after) HWY_ATTR {
      const auto down = hn::Sub(here, load(before + i));
      const auto up = hn::Sub(load(after + i), here);
      return hn::Mul(hn::Set(df, weight), hn::MulAdd(down, down, hn::Mul(up, up)));
    };
    const auto sum = hn::Add(hn::Add(squares(row.weights[0], row.here - 1, row.here + 1),
                                     squares(row.weights[1], row.before_j, row.after_j)),
                             squares(row.weights[2], row.before_k, row.after_k));
    const auto magnitude = hn::Min(hn::Sqrt(sum), hn::Set(df, kLargestByte));
    hn::StoreU(hn::DemoteTo(bytes, hn::NearestInt(magnitude)), bytes, out + i);
  }
}

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(gradient_row);

namespace {

using Row = std::vector<std::uint8_t>;

std::size_t padded(int count) {
  constexpr int kVector = 64;  // at least as many as a vector has lanes
  return static_cast<std::size_t>((count + kVector - 1) / kVector * kVector);
}

/// The voxels beyond the ends of the grid are mirrored, so that the only difference counts twice.
int mirrored(int i, int size) { return i < 0 ? 1 : i == size ? size - 2 : i; }

/// Loads a row of voxels, with one more in front and behind.
void load(const Volume<std::uint8_t>& bytes, int j, int k, Row& row) {
  const Eigen::Vector3i& size = bytes.grid.size;
  const auto count = static_cast<std::size_t>(size.x());
  std::copy_n(&bytes.at(0, mirrored(j, size.y()), mirrored(k, size.z())), count, row.data() + 1);
  row[0] = row[2];
  row[count + 1] = row[count - 1];
}

/// The voxels and magnitudes of two rows, one after the other along j, as words.
struct RowsOfWords {
  const std::uint8_t *first, *second, *first_magnitudes, *second_magnitudes;

  void write(std::size_t count, std::uint32_t* words) const {
    const RowsOfWords rows = *this;  // which no write can change, for all the compiler knows
    for (std::size_t i = 0; i < count; ++i)
      words[i] = static_cast<std::uint32_t>(rows.first[i]) |
                 static_cast<std::uint32_t>(rows.second[i]) << 8 |
                 static_cast<std::uint32_t>(rows.first_magnitudes[i]) << 16 |
                 static_cast<std::uint32_t>(rows.second_magnitudes[i]) << 24;
  }
};

}  // namespace

void write_with_gradient(const Volume<std::uint8_t>& bytes, int k, double per_mm,
                         std::uint32_t* words) {
  const Eigen::Vector3i& size = bytes.grid.size;
  const auto count = static_cast<std::size_t>(size.x());
  const Row empty(padded(size.x()) + 2);
  Row before_j = empty, here = empty, after_j = empty, before_k = empty, after_k = empty;
  Row magnitudes = empty, last_magnitudes = empty;
  RowNeighbours row{};
  for (int axis = 0; axis < 3; ++axis)
    row.weights[axis] =
        static_cast<float>(0.5 * std::pow(bytes.grid.spacing_mm[axis] / per_mm, -2.0));
  load(bytes, -1, k, before_j);
  load(bytes, 0, k, here);
  for (int j = 0; j < size.y(); ++j) {
    load(bytes, j + 1, k, after_j);
    load(bytes, j, k - 1, before_k);
    load(bytes, j, k + 1, after_k);
    row.here = here.data() + 1;
    row.before_j = before_j.data() + 1;
    row.after_j = after_j.data() + 1;
    row.before_k = before_k.data() + 1;
    row.after_k = after_k.data() + 1;
    HWY_DYNAMIC_DISPATCH(gradient_row)(row, padded(size.x()), magnitudes.data());
    if (j > 0) {
      RowsOfWords{row.before_j, row.here, last_magnitudes.data(), magnitudes.data()}.write(count,
                                                                                           words);
      words += count;
    }
    last_magnitudes.swap(magnitudes);
    before_j.swap(here);
    here.swap(after_j);
  }
}

}  // namespace usct
#endif
