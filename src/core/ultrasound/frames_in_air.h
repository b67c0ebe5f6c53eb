#pragma once

#include <cstdint>
#include <vector>

#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct {

/// For each frame, whether the probe was held in air: beyond the first quarter of the depth, which
/// shows the probe's own reverberations there, it is darker than a fifth of what bright frames are.
/// Empty unless most frames were: fewer dark frames, of air or of tissue, are not the usual ones
/// with which lines are compared.
std::vector<std::uint8_t> frames_in_air(const BeamUltrasound& ultrasound);

}  // namespace usct
