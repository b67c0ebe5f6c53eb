#pragma once

#include <string>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/ultrasound/scan_conversion.h"
#include "us_ct_registration/ultrasound/tracked_images.h"

namespace usct {

/// Rule for the value of a voxel that several frames pass through.
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
  /// Whether pixels or samples that are closer than voxels are averaged over a square of the plane
  /// with the side of a voxel (its smallest spacing), up to 8 x 8 points, to avoid aliasing of
  /// speckle. False takes the value at the voxel's centre.
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

}  // namespace usct
