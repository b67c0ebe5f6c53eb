#pragma once

#include <cstdint>
#include <vector>

#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct {

/// For each frame, whether the probe was held in air: beyond the first quarter of the depth, which
/// shows the probe's own reverberations there, it is darker than a fifth of what bright frames are.
/// Empty if no frame was.
std::vector<std::uint8_t> frames_in_air(const BeamUltrasound& ultrasound);

}  // namespace usct
