#pragma once

#include "us_ct_registration/geometry/grid.h"

namespace usct {

/// Greatest distance, in voxels, between voxels of two grids that count as the same: NIfTI files
/// hold positions in single precision.
constexpr double kSameVoxelTolerance = 0.02;

/// Whether each voxel of `part` is a voxel of `whole`, whatever the order and direction of the
/// axes.
bool is_subgrid(const Grid& part, const Grid& whole);

}  // namespace usct
