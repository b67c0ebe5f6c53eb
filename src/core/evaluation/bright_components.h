#pragma once

#include <Eigen/Core>
#include <vector>

#include "us_ct_registration/volume/operations.h"

namespace usct::evaluation {

/// Voxels above a threshold that touch each other, at least by a corner.
struct Component {
  Eigen::Vector3i first;
  Eigen::Vector3i last;
  std::vector<Eigen::Vector3i> voxels;

  Eigen::Vector3d extent_mm(const Grid& grid) const {
    return (last - first + Eigen::Vector3i::Ones()).cast<double>().cwiseProduct(grid.spacing_mm);
  }
};

/// Calls `visit` with the index of each voxel of the region.
template <typename Visit>
void for_each_voxel(const Region& region, const Visit& visit) {
  for (int k = 0; k < region.size.z(); ++k)
    for (int j = 0; j < region.size.y(); ++j)
      for (int i = 0; i < region.size.x(); ++i)
        visit(Eigen::Vector3i(region.begin + Eigen::Vector3i(i, j, k)));
}

/// The components of at least `threshold_hu` that are at most `largest_mm` long along the index
/// axes; larger ones, such as bones, are left out.
std::vector<Component> bright_components(const CtVolume& ct, double threshold_hu,
                                         const Eigen::Vector3d& largest_mm);

}  // namespace usct::evaluation
