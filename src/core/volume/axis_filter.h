#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "us_ct_registration/volume/volume.h"

namespace usct {

/// A filter along one axis, optionally with decimation: out[o] = sum over t of weights[t] *
/// in[begin + o * stride + first + t], with edge values repeated.
struct AxisFilter {
  int first = 0;
  int stride = 1;
  std::vector<float> weights{1.0F};
};

/// A Gaussian about the centre of each block of `stride` voxels, with sigma in voxels, truncated at
/// 3 sigma and normalised. With sigma 0 and stride 1 the filter copies the voxel.
AxisFilter gaussian_filter(double sigma, int stride);

/// Filters along x, y and z. The filters of result voxel (i, j, k) of `out_size` are placed at
/// input voxel `begin + stride * (i, j, k)`. Only the values that the result needs are computed.
/// The work is shared between threads.
template <typename T>
std::vector<float> apply_separable(const Volume<T>& volume,
                                   const std::array<AxisFilter, 3>& filters,
                                   const Eigen::Vector3i& begin, const Eigen::Vector3i& out_size);

}  // namespace usct
