#pragma once

#include <optional>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"
#include "us_ct_registration/ultrasound/ultrasound.h"

/// Turns ultrasound of any kind into the beams that simulation and registration work on.
namespace usct {

struct BeamOptions {
  /// Scan-convert (or compound) to this isotropic spacing first and let the beams run in parallel:
  /// variant A of the thesis. Images whose beams are not known need it. Unset: the true beams. A
  /// Cartesian volume stays as it is.
  std::optional<double> parallel_beams_mm;
  CompoundOptions compounding;
  /// The direction of parallel beams in a Cartesian volume, recorded or scan-converted.
  BeamAxis axis;
  /// Not 0 where a Cartesian volume is known, on the grid of that volume. Without voxels the volume
  /// is known everywhere.
  MaskVolume mask;
};

struct UltrasoundBeams {
  BeamUltrasound along;
  /// The geometry of the true beams; unset if the beams are parallel.
  std::optional<ScanGeometry> geometry;
  /// The grid of the volume that parallel beams run through; unset for true beams.
  std::optional<Grid> grid;
};

/// Throws InputError as `along_beams` and `in_space`; if the spacing is not finite and > 0; if
/// images without beams come without a spacing; or if there is a mask for anything but a Cartesian
/// volume.
UltrasoundBeams beams_of(const Ultrasound& ultrasound, const BeamOptions& options = {},
                         const Progress& progress = {});

}  // namespace usct
