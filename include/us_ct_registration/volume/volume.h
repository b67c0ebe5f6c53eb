#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/grid.h"

namespace usct {

/// Voxels on a grid; `voxels[grid.offset(i, j, k)]`, i fastest.
///
/// The operations in volume/ are compiled for uint8_t, int16_t, uint16_t and float.
template <typename T>
struct Volume {
  Grid grid;
  std::vector<T> voxels;

  Volume() = default;
  explicit Volume(const Grid& grid_in, T fill = T{})
      : grid(grid_in), voxels(grid_in.voxel_count(), fill) {}

  T& at(int i, int j, int k) { return voxels[grid.offset(i, j, k)]; }
  const T& at(int i, int j, int k) const { return voxels[grid.offset(i, j, k)]; }

  /// Throws InputError, naming `source`, unless the grid is valid and there are as many voxels as
  /// it has.
  void validate(const std::string& source) const {
    grid.validate(source);
    if (voxels.size() != grid.voxel_count())
      throw InputError(source, "'voxels' is " + std::to_string(voxels.size()) +
                                   ", must be as many as the grid has, " +
                                   std::to_string(grid.voxel_count()));
  }
};

/// Computed tomography: Hounsfield units, LPS millimetres.
using CtVolume = Volume<std::int16_t>;
/// Scan-converted ultrasound: 8-bit brightness, US frame in millimetres.
using UsVolume = Volume<std::uint8_t>;
/// Mask: 255 where the value is known, 0 where it is not.
using MaskVolume = Volume<std::uint8_t>;
/// One label per voxel, 0 for background.
using LabelVolume = Volume<std::uint16_t>;

}  // namespace usct
