#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// Brightness of ultrasound along beams, independent of the format that it was recorded in; samples
/// x lines x frames, samples fastest.
struct BeamUltrasound {
  BeamGrid beams;
  /// Grey values.
  std::vector<float> brightness;
  /// 0 where the brightness is not known (beside the fan), not 0 elsewhere; empty if all of it is
  /// known.
  std::vector<std::uint8_t> known;

  /// Throws InputError, naming `source`, unless the sizes agree and all known brightness is finite.
  void validate(const std::string& source = "ultrasound") const;
};

/// Variant B of the thesis: the samples along the true beams. Throws InputError if the volume is
/// invalid.
BeamUltrasound along_beams(const PreScanVolume& volume);

/// Variant A of the thesis: parallel beams through a Cartesian volume (see parallel_beam_grid). The
/// mask must have the same grid, or no voxels if all brightness is known; otherwise InputError is
/// thrown.
///
/// Depth is counted from the first voxel of the volume. The depth range, shadows and contact that
/// `condition` finds are therefore less exact than along the true beams.
BeamUltrasound along_beams(const UsVolume& volume, const MaskVolume& mask, BeamAxis axis);

}  // namespace usct
