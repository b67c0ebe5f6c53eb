#include "us_ct_registration/ultrasound/ultrasound.h"

namespace usct {

ScanConverted in_space(const Ultrasound& ultrasound, double spacing_mm,
                       const CompoundOptions& options, const Progress& progress) {
  if (const auto* volume = std::get_if<UsVolume>(&ultrasound))
    return {*volume, MaskVolume(volume->grid, 255)};
  if (const auto* images = std::get_if<TrackedImages>(&ultrasound))
    return compound(*images, image_grid(*images, spacing_mm), options, progress);
  const auto& prescan = std::get<PreScanVolume>(ultrasound);
  const Grid grid = fan_grid(prescan.geometry, spacing_mm);
  return prescan.geometry.is_motorised()
             ? scan_convert(prescan, grid, Interpolation::kTrilinear, progress)
             : compound(prescan, grid, options, progress);
}

}  // namespace usct
