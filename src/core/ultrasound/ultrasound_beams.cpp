#include "us_ct_registration/ultrasound/ultrasound_beams.h"

#include "require.h"
#include "ultrasound/probe_path.h"
#include "ultrasound/stray_frames.h"

namespace usct {
namespace {

constexpr const char* kSource = "ultrasound";

/// Compounded frames can no longer be told from each other, so that wrong poses among them must be
/// found before.
void require_right_poses(const Ultrasound& ultrasound) {
  const auto* prescan = std::get_if<PreScanVolume>(&ultrasound);
  if (prescan == nullptr || prescan->geometry.is_motorised()) return;
  const BeamGrid beams = beam_grid(prescan->geometry);
  if (const std::vector<int> stray = stray_frames(beams); !stray.empty())
    throw InputError(kSource, stray_words(stray, beams.frames) +
                                  ": a compounded volume would have them in it; leave them out of "
                                  "the sweep, or register it along its beams");
  require_no_jump(beams, kSource);
}

}  // namespace

UltrasoundBeams beams_of(const Ultrasound& ultrasound, const BeamOptions& options,
                         const Progress& progress) {
  if (options.parallel_beams_mm)
    require_positive(kSource, "parallel_beams_mm", *options.parallel_beams_mm);
  if (const auto* volume = std::get_if<UsVolume>(&ultrasound))
    return {along_beams(*volume, options.mask, options.axis), {}, volume->grid};
  if (!options.mask.voxels.empty())
    throw InputError(kSource, "'mask' is given, must be left out unless it is a Cartesian volume");
  if (!options.parallel_beams_mm) {
    if (const auto* prescan = std::get_if<PreScanVolume>(&ultrasound))
      return {along_beams(*prescan), prescan->geometry, {}};
    throw InputError(kSource,
                     "'parallel_beams_mm' is missing, must be given for images without beams");
  }
  require_right_poses(ultrasound);
  const ScanConverted converted =
      in_space(ultrasound, *options.parallel_beams_mm, options.compounding, progress);
  return {along_beams(converted.volume, converted.mask, options.axis), {}, converted.volume.grid};
}

}  // namespace usct
