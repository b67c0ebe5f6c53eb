#include "us_ct_registration/geometry/subgrid.h"

#include <optional>

namespace usct {
namespace {

/// The index of the grid's voxel at a point, if there is one.
std::optional<Eigen::Vector3i> voxel_at(const Grid& grid, const Eigen::Vector3d& p_mm) {
  const Eigen::Vector3d index = grid.index_from_physical(p_mm);
  const Eigen::Vector3d nearest = index.array().round();
  if ((index - nearest).cwiseAbs().maxCoeff() > kSameVoxelTolerance) return std::nullopt;
  if ((nearest.array() < 0).any() || (nearest.array() >= grid.size.array().cast<double>()).any())
    return std::nullopt;
  return nearest.cast<int>();
}

}  // namespace

bool is_subgrid(const Grid& part, const Grid& whole) {
  const auto first = voxel_at(whole, part.origin_mm);
  if (!first) return false;
  for (int axis = 0; axis < 3; ++axis) {
    const int steps = part.size[axis] - 1;
    const auto last =
        voxel_at(whole, part.physical_from_index(steps * Eigen::Vector3d::Unit(axis)));
    // The axis must run along one axis of the whole grid, one voxel per step.
    if (!last || (*last - *first).cwiseAbs().sum() != steps ||
        (*last - *first).cwiseAbs().maxCoeff() != steps)
      return false;
  }
  return true;
}

}  // namespace usct
