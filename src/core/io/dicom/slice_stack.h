#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "us_ct_registration/volume/volume.h"

/// Positions of the slices of a series, and their combination into a regular grid. Independent of
/// DICOM.
namespace usct::io {

/// One slice: voxel (i, j) has its centre at
/// position_mm + axes * (i * spacing_mm.x(), j * spacing_mm.y()).
struct SlicePose {
  /// Names the slice in messages.
  std::string name;
  Eigen::Vector2i size = Eigen::Vector2i::Zero();
  Eigen::Vector2d spacing_mm = Eigen::Vector2d::Ones();
  Eigen::Matrix<double, 3, 2> axes = Eigen::Matrix<double, 3, 2>::Identity();
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
};

/// Slices in the order of their positions along the normal.
struct SliceStack {
  /// Indices into the slices given, one per distinct place.
  std::vector<int> order;
  /// The slices at the same place, for each entry of `order`.
  std::vector<std::vector<int>> duplicates;
  /// Distance along the normal, and sideways shift along the two axes, from the first slice on; for
  /// each entry of `order`.
  std::vector<double> depth_mm;
  std::vector<Eigen::Vector2d> shift_mm;

  /// Unit vector: first axis x second axis.
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  /// Median distance along the normal between neighbours; 0 for one slice.
  double spacing_mm = 0.0;
  /// The least distance along the normal between neighbours: the mean of all distances that equal
  /// the smallest one within the tolerance.
  double least_spacing_mm = 0.0;

  /// Reasons why the slices form no grid at all (different sizes, spacings or directions, or a
  /// single slice). The order is known only if this is empty.
  std::vector<std::string> fatal;
  /// Irregularities that resampling can repair: tilt, uneven spacing, missing slices.
  std::vector<std::string> irregular;

  /// The grid that the slices form, fitted to all positions. Not meaningful if irregular.
  Grid grid;
};

/// Slices closer than this are at one place, whatever the spacing.
constexpr double kSamePlaceMm = 1e-3;

/// Distances between neighbours.
std::vector<double> gaps_of(const std::vector<double>& depth_mm);

/// Orders the slices and fits a grid to them. A slice may deviate from its place on the grid by
/// `tolerance`, a fraction of the spacing.
SliceStack stack_slices(const std::vector<SlicePose>& slices, double tolerance);

/// Value of voxels outside all slices: air.
constexpr std::int16_t kAirHu = -1024;
/// No tissue that registration looks at has more. Values up to here that a header declares as
/// padding may be tissue all the same: 0 HU has been declared so, which is water.
constexpr double kDensestTissueHu = 2000.0;

/// A regular grid with the slices' axes and normal, the least spacing between neighbours, and the
/// extent of all slices. Throws InputError, naming `source`, if it has more than 8192 slices, or
/// more than 8192 columns or rows beyond those of a slice.
Grid resampled_grid(const std::string& source, const std::vector<SlicePose>& slices,
                    const SliceStack& stack);

/// The voxels of the slices (in the stack's order) interpolated linearly at their true positions
/// onto the grid above.
CtVolume resample_stack(const std::string& source, const std::vector<SlicePose>& slices,
                        const SliceStack& stack, const std::vector<std::int16_t>& voxels);

}  // namespace usct::io
