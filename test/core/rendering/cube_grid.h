#pragma once

#include "us_ct_registration/geometry/grid.h"

namespace usct::test {

/// `size` voxels along each axis, about the origin.
inline Grid cube(int size, double spacing_mm = 1.0) {
  Grid grid;
  grid.size.setConstant(size);
  grid.spacing_mm.setConstant(spacing_mm);
  grid.origin_mm.setConstant(-0.5 * spacing_mm * (size - 1));
  return grid;
}

}  // namespace usct::test
