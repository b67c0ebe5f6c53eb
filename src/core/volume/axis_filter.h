#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "us_ct_registration/volume/volume.h"

namespace usct {

/// A filter along one axis that may also decimate:
/// out[o] = sum over t of weights[t] * in[begin + o * stride + first + t], edges repeated.
struct AxisFilter {
  int first = 0;
  int stride = 1;
  std::vector<float> weights{1.0F};
};

/// A Gaussian with sigma in voxels, sampled out to 3 sigma and normalised, about the centre of each
/// block of `stride` voxels. sigma 0 reads the voxel (stride 1) and smooths nothing.
AxisFilter gaussian_filter(double sigma, int stride);

/// Filters along x, y and z. Result voxel (i, j, k) of `out_size` belongs to the input voxels
/// around `begin + stride * (i, j, k)`. Only voxels that a result
/// depends on are computed; multi-threaded.
template <typename T>
std::vector<float> apply_separable(const Volume<T>& volume,
                                   const std::array<AxisFilter, 3>& filters,
                                   const Eigen::Vector3i& begin, const Eigen::Vector3i& out_size);

}  // namespace usct
