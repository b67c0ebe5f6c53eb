#pragma once

#include <variant>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/ultrasound/compounding.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/ultrasound/scan_conversion.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// Ultrasound of any kind: before scan conversion, as B-mode images whose beams are not known, or
/// as a Cartesian volume.
using Ultrasound = std::variant<PreScanVolume, TrackedImages, UsVolume>;

/// The ultrasound on a Cartesian grid of isotropic `spacing_mm` in the US frame, by scan conversion
/// or compounding. A Cartesian volume is returned unchanged, with all voxels known.
ScanConverted in_space(const Ultrasound& ultrasound, double spacing_mm,
                       const CompoundOptions& options, const Progress& progress = {});

}  // namespace usct
