#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// Ultrasound along its beams, the same for every kind of recording: samples x lines x frames
/// values, samples fastest.
struct BeamUltrasound {
  BeamGrid beams;
  /// Grey values.
  std::vector<float> brightness;
  /// Per sample: 0 where the brightness is unknown (beside the fan). Empty if all samples are
  /// known.
  std::vector<std::uint8_t> known;

  /// Throws InputError, naming `source`, unless the sizes agree and known samples are finite.
  void validate(const std::string& source = "ultrasound") const;
};

/// Variant B of the thesis: along the true beams. Throws InputError if the volume is invalid.
BeamUltrasound along_beams(const PreScanVolume& volume);

/// Variant A: along parallel beams through a Cartesian volume (see parallel_beam_grid). The mask
/// has the same grid, or no voxels if all is known. Throws InputError otherwise.
///
/// Depth is then counted from the first voxel of the volume, so that the depths, shadows and
/// contact that `condition` finds are cruder than along the true beams.
BeamUltrasound along_beams(const UsVolume& volume, const MaskVolume& mask, BeamAxis axis);

}  // namespace usct
