#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <mutex>

#include "large_pages.h"
#include "us_ct_registration/volume/hu_window.h"
#include "us_ct_registration/volume/operations.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// The highest value of a voxel of a PackedCt.
constexpr float kLargestByte = 255.0F;

/// A CT with the magnitude of its gradient, 8 bits per voxel each.
struct PackedGradient {
  /// At the places of PackedCt::pairs(): the pair of the CT in the low half of a word, that of the
  /// gradient's magnitude in the high half.
  LargeVector<std::uint32_t> words;
  /// Steps of the CT's byte per mm in one step of a byte of the gradient. The largest byte is a
  /// change by the whole window from one voxel to the next.
  double step_per_mm = 0.0;
};

/// CT values in bytes: limited to a window, and rounded to a 255th of it.
class BytesOfCt {
 public:
  /// Throws InputError if the window is invalid.
  explicit BytesOfCt(const HuWindow& window);
  void operator()(const float* hu, std::size_t count, std::uint8_t* bytes) const;

 private:
  float low_;
  float scale_;
};

/// A CT made for fast trilinear sampling: 8 bits per voxel over a window of CT values. Each voxel
/// is stored with its neighbour along j, so that two loads of 32 bits fetch the eight voxels of a
/// cell, for value and gradient. Words with more neighbours would take fewer loads, but the CT
/// would no longer fit into any cache.
class PackedCt {
 public:
  /// CT values are limited to the window, and rounded to a 255th of it. `background_hu` is the CT
  /// value outside the CT. Throws InputError if the grid is invalid or smaller than 2 voxels along
  /// an axis, or if the window is invalid, or the background lies outside it.
  PackedCt(const Volume<float>& ct_hu, const HuWindow& window, double background_hu);
  /// A region of a CT that is in bytes on the scale of the window already. Throws InputError for an
  /// invalid region too.
  PackedCt(const Volume<std::uint8_t>& bytes, const Region& region, const HuWindow& window,
           double background_hu);

  /// The grid of the voxels.
  const Grid& grid() const { return grid_; }
  /// Pairs of voxels: (i, j, k) in the low byte, (i, j + 1, k) in the high one, at i + j *
  /// stride_j() + k * stride_k(); the last j has no pair.
  const LargeVector<std::uint16_t>& pairs() const { return pairs_; }
  std::size_t stride_j() const { return stride_j_; }
  std::size_t stride_k() const { return stride_k_; }
  /// HU per step of a byte.
  double step_hu() const { return step_hu_; }
  /// The background on the scale of the bytes.
  double background() const { return background_; }

  /// The CT together with the magnitude of its gradient as a volume of its own, made on first use;
  /// safe from several threads. The gradient of the trilinear interpolation jumps at the borders of
  /// cells, so that its derivative within a cell says nothing of how it changes from cell to cell;
  /// the trilinear interpolation of its magnitudes at the voxels does. A voxel has the root mean
  /// square of the magnitudes that the cells around it have there.
  const PackedGradient& gradient() const;

 private:
  PackedCt(Grid grid, const HuWindow& window, double background_hu);
  /// `row_bytes(j, k, bytes)` gives a row of voxels.
  template <typename RowBytes>
  void pack(const RowBytes& row_bytes);

  Grid grid_;
  std::size_t stride_j_ = 0;
  std::size_t stride_k_ = 0;
  double step_hu_ = 0.0;
  double background_ = 0.0;
  LargeVector<std::uint16_t> pairs_;
  mutable std::once_flag gradient_made_;
  mutable std::unique_ptr<const PackedGradient> gradient_;
};

}  // namespace usct
