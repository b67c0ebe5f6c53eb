#pragma once

#include <optional>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"
#include "us_ct_registration/ultrasound/ultrasound.h"

/// The one way from ultrasound of any kind to the beams that simulation and registration see.
namespace usct {

struct BeamOptions {
  /// Scan-convert (or compound) to this isotropic spacing first and let the beams run in parallel:
  /// variant A of the thesis. Images whose beams are not known need it. Unset: the true beams. A
  /// Cartesian volume stays as it is.
  std::optional<double> parallel_beams_mm;
  CompoundOptions compounding;
  /// The way of the beams in a Cartesian volume, or in what scan conversion makes.
  BeamAxis axis;
  /// Where a Cartesian volume is known (not 0), on its grid; no voxels: everywhere.
  MaskVolume mask;
};

struct UltrasoundBeams {
  BeamUltrasound along;
  /// Whose beams they are; unset if they are parallel.
  std::optional<ScanGeometry> geometry;
  /// The volume that parallel beams run through.
  std::optional<Grid> grid;
};

/// Throws InputError as `along_beams` and `in_space`; if the spacing is not finite and > 0; if
/// images without beams come without a spacing; or if there is a mask for anything but a Cartesian
/// volume.
UltrasoundBeams beams_of(const Ultrasound& ultrasound, const BeamOptions& options = {},
                         const Progress& progress = {});

}  // namespace usct
