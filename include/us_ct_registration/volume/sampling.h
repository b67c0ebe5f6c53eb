#pragma once

#include <Eigen/Core>
#include <cmath>

#include "us_ct_registration/volume/volume.h"

namespace usct {

enum class Interpolation { kNearest, kTrilinear };

/// The value of a sample outside the volume. There is no default: each caller has to choose.
///
/// The volume ends half a voxel beyond the centres of its outermost voxels; in that last half voxel
/// trilinear sampling repeats the edge.
struct Outside {
  enum class Kind { kConstant, kEdge };
  Kind kind;
  float constant_value;

  /// Every sample outside has the value `value`.
  static Outside constant(float value) { return {Kind::kConstant, value}; }
  /// A sample outside has the value of the nearest voxel.
  static Outside edge() { return {Kind::kEdge, 0.0F}; }
};

/// Whether a continuous index lies in the volume, to which voxels belong with their full extent.
inline bool contains_index(const Grid& grid, const Eigen::Vector3d& index) {
  return (index.array() >= -0.5).all() &&
         (index.array() < grid.size.cast<double>().array() - 0.5).all();
}

/// Value at a continuous index. A NaN index counts as outside; with Outside::edge() it gives NaN.
template <typename T>
float sample_at_index(const Volume<T>& volume, const Eigen::Vector3d& index,
                      Interpolation interpolation, Outside outside);

/// Value at a physical point, in the volume's frame.
template <typename T>
float sample(const Volume<T>& volume, const Eigen::Vector3d& p_mm, Interpolation interpolation,
             Outside outside) {
  return sample_at_index(volume, volume.grid.index_from_physical(p_mm), interpolation, outside);
}

}  // namespace usct
