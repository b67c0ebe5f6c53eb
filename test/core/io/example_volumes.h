#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <vector>

#include "us_ct_registration/volume/volume.h"

namespace usct::test {

/// Hounsfield units as a function of the position in the patient, independent of any grid.
inline double hounsfield_at(const Eigen::Vector3d& p_mm) {
  return 300.0 * std::sin(0.11 * p_mm.x() + 0.3) * std::cos(0.07 * p_mm.y()) + 4.0 * p_mm.z() -
         100.0;
}

inline CtVolume sampled(const Grid& grid) {
  CtVolume volume(grid);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i)
        volume.at(i, j, k) = static_cast<std::int16_t>(
            std::lround(hounsfield_at(grid.physical_from_index(Eigen::Vector3d(i, j, k)))));
  return volume;
}

struct NamedGrid {
  std::string name;
  Grid grid;
};

/// Grids that a reader could mix up: unequal sizes and spacings, permuted axes, reversed axes, a
/// left-handed order, and oblique axes.
inline std::vector<NamedGrid> example_grids() {
  Grid grid;
  grid.size = {7, 5, 4};
  grid.spacing_mm = {0.75, 1.25, 2.5};
  grid.origin_mm = {-31.5, 47.25, -812.75};
  std::vector<NamedGrid> grids{{"axes_in_place", grid}};
  grid.direction << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  grids.push_back({"permuted", grid});
  grid.direction = Eigen::Vector3d(-1, 1, -1).asDiagonal();
  grids.push_back({"flipped", grid});
  grid.direction = Eigen::Vector3d(1, 1, -1).asDiagonal();
  grids.push_back({"left_handed", grid});
  grid.direction = Eigen::AngleAxisd(0.6, Eigen::Vector3d(1.0, -2.0, 3.0).normalized()).matrix();
  grids.push_back({"oblique", grid});
  grid.direction.col(1) *= -1.0;
  grids.push_back({"oblique_left_handed", grid});
  return grids;
}

}  // namespace usct::test
