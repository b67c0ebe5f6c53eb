#pragma once

#include <optional>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"
#include "us_ct_registration/ultrasound/ultrasound.h"

/// Conversion of ultrasound of any kind to the beams that simulation and registration use.
namespace usct {

struct BeamOptions {
  /// If set, the ultrasound is first scan-converted (or compounded) to this isotropic spacing, and
  /// its beams are parallel (variant A of the thesis); images whose beams are not known need this.
  /// If unset, the true beams are used. A Cartesian volume keeps its voxels in either case.
  std::optional<double> parallel_beams_mm;
  CompoundOptions compounding;
  /// Direction of the beams in a Cartesian volume, or in the scan-converted one.
  BeamAxis axis;
  /// Mask of a Cartesian volume, on its grid: not 0 where it is known. Without voxels it is known
  /// everywhere.
  MaskVolume mask;
};

struct UltrasoundBeams {
  BeamUltrasound along;
  /// Geometry of the true beams; unset if they are parallel.
  std::optional<ScanGeometry> geometry;
  /// Grid of the volume through which parallel beams run; unset otherwise.
  std::optional<Grid> grid;
};

/// Throws InputError as `along_beams` and `in_space` do; if the spacing is not finite and > 0; if
/// images without beams come without a spacing; or if there is a mask for anything but a Cartesian
/// volume.
UltrasoundBeams beams_of(const Ultrasound& ultrasound, const BeamOptions& options = {},
                         const Progress& progress = {});

}  // namespace usct
