#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "us_ct_registration/similarity/large_pages.h"
#include "us_ct_registration/simulation/hu_window.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// A CT made for fast trilinear sampling: 8 bits per voxel over a window of CT values, and for each
/// cell between eight voxels all eight of them in one 64-bit word, so that one load brings value
/// and gradient.
///
/// The lowest byte is voxel (0, 0, 0) of the cell; bit 0 of a byte's index steps along i, bit 1
/// along j, bit 2 along k.
class PackedCt {
 public:
  /// CT values are limited to the window, and rounded to a 255th of it. `background_hu` is what
  /// lies outside the CT. Throws InputError if the grid is invalid or smaller than 2 voxels along
  /// an axis, or if the window is, or the background lies outside it.
  PackedCt(const Volume<float>& ct_hu, const HuWindow& window, double background_hu);

  /// Of the voxels; there is one cell less along each axis.
  const Grid& grid() const { return grid_; }
  const LargeVector<std::uint64_t>& cells() const { return cells_; }
  std::size_t cell_stride_j() const { return stride_j_; }
  std::size_t cell_stride_k() const { return stride_k_; }
  /// HU per step of a byte.
  double step_hu() const { return step_hu_; }
  /// The background on the scale of the bytes.
  double background() const { return background_; }

 private:
  Grid grid_;
  std::size_t stride_j_ = 0;
  std::size_t stride_k_ = 0;
  double step_hu_ = 0.0;
  double background_ = 0.0;
  LargeVector<std::uint64_t> cells_;
};

}  // namespace usct
