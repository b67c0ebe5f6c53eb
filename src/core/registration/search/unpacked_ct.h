#pragma once

#include <Eigen/Core>
#include <vector>

#include "similarity/packed_ct.h"

namespace usct::registration {

/// A packed CT and the magnitude of its gradient as numbers, for trilinear interpolation.
class UnpackedCt {
 public:
  explicit UnpackedCt(const PackedCt& ct);
  /// Fills a row of a lattice; it begins at `first` and goes on by `step`, indices of the CT.
  void sample(const Eigen::Vector3d& first, const Eigen::Vector3d& step, std::size_t count,
              float* value, float* gradient) const;
  const Grid& grid() const { return grid_; }

 private:
  using Voxel = Eigen::Array2f;  // HU above the window's lower end, HU/mm
  Voxel at(const Eigen::Vector3d& index) const;

  Grid grid_;
  float background_hu_;
  std::vector<Voxel> voxels_;
};

}  // namespace usct::registration
