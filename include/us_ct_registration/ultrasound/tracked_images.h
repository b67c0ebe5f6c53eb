#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/grid.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"

namespace usct {

/// B-mode images with a pose each, as grabbed from a scanner's screen while the probe is tracked.
/// The beams within the images are not known.
struct TrackedImages {
  int width = 0;   // columns
  int height = 0;  // rows
  /// Brightness, width x height x images, columns fastest.
  std::vector<std::uint8_t> pixels;
  /// Maps (column, row, 0), whole at pixel centres, to the US frame in mm, per image. Affine, since
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

/// The smallest axis-aligned isotropic grid, in the US frame, that covers all shown pixels. Throws
/// InputError if the images are invalid or the spacing is not > 0.
Grid image_grid(const TrackedImages& images, double spacing_mm);

/// Placement of a probe in its B-mode images.
struct ImagePlacement {
  /// Column and row of the origin of frame coordinates: the centre of curvature of the array, or
  /// the middle of the array if it is linear. May lie outside the image.
  Eigen::Vector2d origin_px = Eigen::Vector2d::Zero();
  /// Size of a pixel along columns (x, lateral) and rows (y, axial); negative if the image's axis
  /// runs against that of the frame.
  Eigen::Vector2d spacing_mm = Eigen::Vector2d::Ones();
};

/// The pose of the frame coordinates in the frame, in mm, to which `T_pixel` maps (column, row, 0).
///
/// `T_pixel` and the placement's pixel size must agree within 1 % in scale and 0.01 in the cosine
/// of the angle between columns and rows; the nearest rotation is taken. Throws InputError, naming
/// `source`, where they do not.
Eigen::Isometry3d array_pose(const Eigen::Affine3d& T_pixel, const ImagePlacement& placement,
                             const std::string& source);

/// B-mode images resampled along the true beams: a tracked pre-scan volume with one frame per
/// image. Samples that no image pixel shows are 0. Throws InputError as `array_pose` and
/// `ImageBeams`, or if the images are invalid.
PreScanVolume prescan_from_images(const TrackedImages& images, const Array& array,
                                  const AxialSampling& axial, const ImagePlacement& placement);

}  // namespace usct
