#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/volume/sampling.h"
#include "us_ct_registration/volume/volume.h"

/// Operations on whole volumes: multi-threaded, and the same bits for any number of threads.
/// Integer results are rounded to nearest and clamped to the range of the voxel type.
namespace usct {

/// A block of voxels: [begin, begin + size) in index coordinates.
struct Region {
  Eigen::Vector3i begin = Eigen::Vector3i::Zero();
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
};

/// The region that holds all voxels of a grid.
Region whole(const Grid& grid);

/// The smallest region of `grid` that holds all the points (physical, mm) with `margin_mm` around
/// them, clipped to the grid. Its size is zero if all of this lies
/// outside the grid.
Region region_around(const Grid& grid, const std::vector<Eigen::Vector3d>& points_mm,
                     double margin_mm);

/// The voxels of a region, at the same physical positions. Throws InputError if the region is
/// empty or not within the volume.
template <typename T>
Volume<T> crop(const Volume<T>& volume, const Region& region);

/// `source` sampled on `target`: voxel at p_target takes the value at T_source_target * p_target.
template <typename T>
Volume<T> resample(const Volume<T>& source, const Grid& target,
                   const Eigen::Isometry3d& T_source_target, Interpolation interpolation,
                   Outside outside, const Progress& progress = {});

/// Gaussian smoothing with a standard deviation in millimetres per index axis (0 leaves an axis as
/// it is), cut off at 3 sigma, edges repeated; only the voxels of `region` are computed and
/// returned. Reads no more than 3 sigma around the region.
template <typename T>
Volume<float> smooth_gaussian(const Volume<T>& volume, const Eigen::Vector3d& sigma_mm,
                              const Region& region);

/// Smaller by whole factors per axis: each voxel of the result is at the centre of a block of
/// `factors` voxels of `region`, smoothed with sigma = 0.5 * factor voxels (no smoothing for factor
/// 1) and read at the block's centre. Smoothing and decimation are one pass per axis (polyphase):
/// values that decimation would drop are not computed. Throws InputError if a factor is < 1 or >
/// the region's size.
template <typename T>
Volume<float> shrink(const Volume<T>& volume, const Eigen::Vector3i& factors, const Region& region);

/// One level per entry of `factors`, each shrunk from the full resolution.
template <typename T>
std::vector<Volume<float>> pyramid(const Volume<T>& volume,
                                   const std::vector<Eigen::Vector3i>& factors,
                                   const Region& region);

/// The same values at the same physical positions, with axes permuted and flipped so that they are
/// as close to the identity as possible.
template <typename T>
Volume<T> reorient_to_axes(const Volume<T>& volume);

}  // namespace usct
