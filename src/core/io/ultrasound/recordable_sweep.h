#pragma once

#include <filesystem>

#include "us_ct_registration/ultrasound/prescan_volume.h"

namespace usct::io {

/// The signed angle from frame to frame of a sweep that a recording of a motorised probe can hold.
/// Throws InputError, naming `path`, for a tracked sweep and for frames at uneven angles.
double recordable_pitch_rad(const PreScanVolume& volume, const std::filesystem::path& path);

/// The angle, >= 0, in thousandths of a degree, truncated as the scanner does (Propello).
int truncated_millidegrees(double angle_rad);

}  // namespace usct::io
