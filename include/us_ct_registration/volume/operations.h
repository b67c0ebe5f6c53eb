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

/// The region that covers the whole grid.
Region whole(const Grid& grid);

/// The grid of a region's voxels. Throws InputError if the region is empty or not within the grid.
Grid region_grid(const Grid& grid, const Region& region);

/// The grid of what `shrink` makes of a region. Throws InputError as `shrink`.
Grid shrunk_grid(const Grid& grid, const Eigen::Vector3i& factors, const Region& region);

/// The smallest region of `grid` that holds all the points (physical, mm) with `margin_mm` around
/// them, clipped to the grid. Its size is zero if the points and their margin lie outside the grid.
Region region_around(const Grid& grid, const std::vector<Eigen::Vector3d>& points_mm,
                     double margin_mm);

/// The voxels of a region, at the same physical positions. Throws InputError if the region is
/// empty or not within the volume.
template <typename T>
Volume<T> crop(const Volume<T>& volume, const Region& region);

/// Samples `source` on the grid `target`: the voxel at p_target gets the value at T_source_target *
/// p_target.
template <typename T>
Volume<T> resample(const Volume<T>& source, const Grid& target,
                   const Eigen::Isometry3d& T_source_target, Interpolation interpolation,
                   Outside outside, const Progress& progress = {});

/// Gaussian smoothing with a standard deviation in millimetres per index axis (0: this axis is not
/// smoothed), truncated at 3 sigma, with edge values repeated. Only the voxels of `region` are
/// computed and returned; no voxel farther than 3 sigma from the region is read.
template <typename T>
Volume<float> smooth_gaussian(const Volume<T>& volume, const Eigen::Vector3d& sigma_mm,
                              const Region& region);

/// Reduces a region by an integer factor per axis. Each voxel of the result lies at the centre of a
/// block of `factors` voxels, and is the value there after smoothing with sigma = 0.5 * factor
/// voxels (no smoothing for factor 1). Smoothing and decimation are one pass per axis (polyphase),
/// so that values that decimation would discard are never computed. Throws InputError if a factor
/// is < 1 or greater than the size of the region.
template <typename T>
Volume<float> shrink(const Volume<T>& volume, const Eigen::Vector3i& factors, const Region& region);

/// One level per entry of `factors`, each shrunk from the full resolution.
template <typename T>
std::vector<Volume<float>> pyramid(const Volume<T>& volume,
                                   const std::vector<Eigen::Vector3i>& factors,
                                   const Region& region);

/// Permutes and flips the axes so that they come as close to the identity as possible. Every value
/// stays at its physical position.
template <typename T>
Volume<T> reorient_to_axes(const Volume<T>& volume);

}  // namespace usct
