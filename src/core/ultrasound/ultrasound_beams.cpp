#include "us_ct_registration/ultrasound/ultrasound_beams.h"

#include "require.h"

namespace usct {
namespace {

constexpr const char* kSource = "ultrasound";

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
  const ScanConverted converted =
      in_space(ultrasound, *options.parallel_beams_mm, options.compounding, progress);
  return {along_beams(converted.volume, converted.mask, options.axis), {}, converted.volume.grid};
}

}  // namespace usct
