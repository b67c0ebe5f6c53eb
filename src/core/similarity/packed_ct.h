#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>

#include "similarity/packed_voxels.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// A CT with the magnitude of its gradient, 8 bits per voxel each.
struct PackedGradient {
  /// PackedVoxels::with_gradient, at the places of PackedCt::pairs().
  const std::uint32_t* words = nullptr;
  /// PackedVoxels::gradient_step_per_mm.
  double step_per_mm = 0.0;
};

/// A CT made for fast trilinear sampling: 8 bits per voxel over a window of CT values. Each voxel
/// is stored with its neighbour along j, so that two loads of 32 bits fetch the eight voxels of a
/// cell, for value and gradient. Words with more neighbours would take fewer loads, but the CT
/// would no longer fit into any cache.
///
/// It is a region of PackedVoxels, which may be larger. Nothing beyond the region counts as CT.
class PackedCt {
 public:
  /// CT values are limited to the window, and rounded to a 255th of it. `background_hu` is the CT
  /// value outside the CT. Throws InputError if the grid is invalid or smaller than 2 voxels along
  /// an axis, or if the window is invalid, or the background lies outside it.
  PackedCt(const Volume<float>& ct_hu, const HuWindow& window, double background_hu);
  /// The voxels from `begin` on, as many as the grid has. Throws InputError if there are fewer,
  /// too.
  PackedCt(std::shared_ptr<const PackedVoxels> voxels, const Eigen::Vector3i& begin, Grid grid,
           double background_hu);

  /// The grid of the region.
  const Grid& grid() const { return grid_; }
  /// PackedVoxels::pairs from the first voxel of the region on: (i, j, k) is at i + j * stride_j()
  /// + k * stride_k(); the last j has no pair.
  const std::uint16_t* pairs() const { return pairs_; }
  std::size_t stride_j() const { return voxels_->stride_j(); }
  std::size_t stride_k() const { return voxels_->stride_k(); }
  /// HU per step of a byte.
  double step_hu() const { return step_hu_; }
  /// The background on the scale of the bytes.
  double background() const { return background_; }

  /// The CT together with the magnitude of its gradient as a volume of its own, made on first use
  /// of the voxels; safe from several threads. The gradient of the trilinear interpolation jumps at
  /// the borders of cells, so that its derivative within a cell says nothing of how it changes from
  /// cell to cell; the trilinear interpolation of its magnitudes at the voxels does. A voxel has
  /// the root mean square of the magnitudes that the cells around it have there, those beyond the
  /// region too.
  PackedGradient gradient() const;

 private:
  std::shared_ptr<const PackedVoxels> voxels_;
  Grid grid_;
  double step_hu_ = 0.0;
  double background_ = 0.0;
  const std::uint16_t* pairs_ = nullptr;
};

}  // namespace usct
