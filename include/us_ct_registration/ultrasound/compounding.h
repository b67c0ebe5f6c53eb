#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/ultrasound/scan_conversion.h"

namespace usct {

/// B-mode images with a pose each, as grabbed from a scanner's screen while the probe is tracked.
/// Nothing is known of the beams.
struct TrackedImages {
  int width = 0;   // columns
  int height = 0;  // rows
  /// Brightness, width x height x images, columns fastest.
  std::vector<std::uint8_t> pixels;
  /// Per image: maps (column, row, 0), whole at pixel centres, to the US frame in mm. Affine, since
  /// pixels need not be square nor a calibration exactly rigid; its third column is not used.
  std::vector<Eigen::Affine3d> T_us_pixel;
  /// width x height, columns fastest: 0 where the image shows no ultrasound (text, scales, beyond
  /// the fan). Empty if all of it does.
  std::vector<std::uint8_t> shown;
  /// Acquisition time per image in seconds; empty if unknown, else one per image.
  std::vector<double> times_s;

  int count() const { return static_cast<int>(T_us_pixel.size()); }

  /// Throws InputError, naming `source`, unless the sizes agree, there is at least one image, each
  /// transform is finite with the first two columns independent, and times are finite and do not
  /// fall.
  void validate(const std::string& source) const;
};

/// Pixels of a rectangle of columns x rows, as a `TrackedImages::shown`. Throws InputError if the
/// rectangle does not lie within the image.
std::vector<std::uint8_t> shown_rectangle(int width, int height, int first_column, int first_row,
                                          int columns, int rows);

/// What a voxel is worth that several frames pass through.
enum class Compounding {
  kMean,     // mean, weighted by 1 - distance / half thickness
  kMaximum,  // the brightest
  kLatest,   // the last frame of the sweep
};

struct CompoundOptions {
  Compounding compounding = Compounding::kMean;
  /// A frame fills the voxels whose centres lie within half of this from its plane. Below 1.75
  /// voxels even one frame may leave pinholes.
  double slice_thickness_mm = 1.0;
  /// Where pixels or samples are closer than voxels, takes the mean over a square of the plane with
  /// the side of a voxel (its smallest spacing), up to 8 x 8 points; else speckle aliases. False
  /// takes the value at the voxel's centre.
  bool average_in_plane = true;
  /// An empty voxel is filled, and counted as known, if known voxels face each other across it
  /// within this distance, on either side, along one of the 13 directions to its neighbours:
  /// gaps are bridged, the outside does not grow. 0 leaves gaps open.
  double hole_fill_radius_mm = 0.0;

  /// Throws InputError unless the thickness is finite and > 0 and the radius finite and >= 0.
  void validate(const std::string& source) const;
};

/// A tracked pre-scan sweep as a Cartesian volume in the US frame: in the plane of each frame the
/// closed-form inverse of the array and linear interpolation, half a sample and half a line beyond
/// the outermost ones included; across frames `options`. Throws InputError if something is invalid
/// or the sweep is motorised (see `scan_convert`).
ScanConverted compound(const PreScanVolume& prescan, const Grid& grid,
                       const CompoundOptions& options, const Progress& progress = {});

/// Tracked B-mode images as a Cartesian volume in the US frame; bilinear within the image, between
/// pixels that show ultrasound.
ScanConverted compound(const TrackedImages& images, const Grid& grid,
                       const CompoundOptions& options, const Progress& progress = {});

/// The smallest axis-aligned isotropic grid that covers what the images show.
Grid image_grid(const TrackedImages& images, double spacing_mm);

/// How a probe appears in its B-mode images.
struct ImagePlacement {
  /// Column and row of the origin of frame coordinates: the centre of curvature of the array, or
  /// the middle of the array if it is linear. May lie outside the image.
  Eigen::Vector2d origin_px = Eigen::Vector2d::Zero();
  /// Size of a pixel along columns (x, lateral) and rows (y, axial); negative where the image runs
  /// the other way.
  Eigen::Vector2d spacing_mm = Eigen::Vector2d::Ones();
};

/// B-mode images resampled along the true beams: a tracked pre-scan volume with one frame per
/// image. Samples that no image pixel shows are 0.
///
/// A frame has a rigid pose: `T_us_pixel` and the placement's pixel size must agree within 1 % in
/// scale and 0.01 in the cosine of the angle between columns and rows; the nearest rotation is
/// taken. Throws InputError where they do not, if a part is invalid, or if the images show no
/// sample at all.
PreScanVolume prescan_from_images(const TrackedImages& images, const Array& array,
                                  const AxialSampling& axial, const ImagePlacement& placement);

}  // namespace usct
