#pragma once

#include "us_ct_registration/ultrasound/scan_conversion.h"

namespace usct {

/// Bridges gaps of up to `radius_mm` to either side between known voxels; see
/// CompoundOptions::hole_fill_radius_mm.
ScanConverted with_holes_filled(const ScanConverted& known, double radius_mm);

}  // namespace usct
