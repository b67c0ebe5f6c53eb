// The file is compiled once per instruction set; the machine's best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/packed_gradient.cpp"
#include "similarity/packed_gradient.h"

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <cmath>

#include "parallel.h"

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

/// The bytes of a CT row by row, each with its first and last voxel once more beyond its ends, and
/// padded to whole vectors. At the ends of the grid the only difference counts twice, so that the
/// voxels beyond are mirrored.
class Rows {
 public:
  explicit Rows(const PackedCt& ct)
      : ct_(ct), count_(static_cast<std::size_t>(ct.grid().size.x())) {}

  std::size_t padded() const { return (count_ + kVector - 1) / kVector * kVector; }
  std::vector<std::uint8_t> empty() const { return std::vector<std::uint8_t>(padded() + 2); }

  void load(int j, int k, std::vector<std::uint8_t>& row) const {
    const Eigen::Vector3i& size = ct_.grid().size;
    j = mirrored(j, size.y());
    k = mirrored(k, size.z());
    // The last j has no pair; it is the upper half of the pair before.
    const bool is_last = j + 1 == size.y();
    const int shift = is_last ? 8 : 0;
    const std::uint16_t* pairs = ct_.pairs().data() + static_cast<std::size_t>(k) * ct_.stride_k() +
                                 static_cast<std::size_t>(is_last ? j - 1 : j) * ct_.stride_j();
    for (std::size_t i = 0; i < count_; ++i)
      row[i + 1] = static_cast<std::uint8_t>(pairs[i] >> shift);
    row[0] = row[2];
    row[count_ + 1] = row[count_ - 1];
  }

 private:
  static constexpr std::size_t kVector = 64;  // at least as many as a vector has lanes
  static int mirrored(int i, int size) { return i < 0 ? 1 : i == size ? size - 2 : i; }

  const PackedCt& ct_;
  std::size_t count_;
};

}  // namespace

PackedGradient with_gradient(const PackedCt& ct) {
  const Grid& grid = ct.grid();
  PackedGradient result;
  result.step_per_mm = 1.0 / grid.spacing_mm.minCoeff();
  result.words.resize(ct.pairs().size());
  RowNeighbours weighted{};
  for (int axis = 0; axis < 3; ++axis)
    weighted.weights[axis] =
        static_cast<float>(0.5 * std::pow(grid.spacing_mm[axis] * result.step_per_mm, -2.0));
  const Rows rows(ct);
  parallel_for(grid.size.z(), [&](int k) {
    std::vector<std::uint8_t> before_j = rows.empty(), here = before_j, after_j = before_j,
                              before_k = before_j, after_k = before_j, magnitudes = before_j,
                              last = before_j;
    rows.load(-1, k, before_j);
    rows.load(0, k, here);
    std::size_t at = static_cast<std::size_t>(k) * ct.stride_k();
    for (int j = 0; j < grid.size.y(); ++j) {
      rows.load(j + 1, k, after_j);
      rows.load(j, k - 1, before_k);
      rows.load(j, k + 1, after_k);
      RowNeighbours row = weighted;
      row.here = here.data() + 1;
      row.before_j = before_j.data() + 1;
      row.after_j = after_j.data() + 1;
      row.before_k = before_k.data() + 1;
      row.after_k = after_k.data() + 1;
      HWY_DYNAMIC_DISPATCH(gradient_row)(row, rows.padded(), magnitudes.data());
      if (j > 0)
        for (std::size_t i = 0; i < ct.stride_j(); ++i, ++at)
          result.words[at] = static_cast<std::uint32_t>(ct.pairs()[at]) |
                             static_cast<std::uint32_t>(last[i]) << 16 |
                             static_cast<std::uint32_t>(magnitudes[i]) << 24;
      last.swap(magnitudes);
      before_j.swap(here);
      here.swap(after_j);
    }
  });
  return result;
}

}  // namespace usct
#endif
