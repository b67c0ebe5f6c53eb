#pragma once

#include <gtest/gtest.h>

#include "core/io/example_volumes.h"
#include "us_ct_registration/volume/volume.h"

namespace usct::test {

inline Grid small_grid() { return example_grids()[0].grid; }

/// Each voxel must hold the value of the patient of example_volumes.h at its position.
inline void expect_shows_the_patient(const CtVolume& volume, double tolerance_hu) {
  ASSERT_EQ(volume.voxels.size(), volume.grid.voxel_count());
  for (int k = 0; k < volume.grid.size.z(); ++k)
    for (int j = 0; j < volume.grid.size.y(); ++j)
      for (int i = 0; i < volume.grid.size.x(); ++i) {
        const Eigen::Vector3d p = volume.grid.physical_from_index(Eigen::Vector3d(i, j, k));
        ASSERT_NEAR(volume.at(i, j, k), hounsfield_at(p), tolerance_hu)
            << "at voxel " << i << " " << j << " " << k;
      }
}

/// Hounsfield units are rounded to whole numbers, and positions to the 16 characters of a decimal
/// string.
constexpr double kRounding = 0.5 + 1e-4;

}  // namespace usct::test
