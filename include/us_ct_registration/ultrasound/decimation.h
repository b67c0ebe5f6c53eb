#pragma once

#include <Eigen/Core>

#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct {

/// Ultrasound with fewer samples, lines and frames: each is the mean of a block of what is known,
/// and lies in the block's middle (the mean beam of the block). A block of which less than half is
/// known is not known. What a last, incomplete block would hold is left out.
///
/// `factors`: samples, lines and frames per block, >= 1. Throws InputError if one is not, or is
/// greater than what there is.
BeamUltrasound decimate(const BeamUltrasound& ultrasound, const Eigen::Vector3i& factors);

/// Blocks whose edges come closest to `spacing_mm`, judged in the middle of the depths for lines
/// (in the middle frame) and for frames (on the middle line); at least 1, and at most half of what
/// there is so that an axis keeps two blocks. Throws InputError unless the spacing is finite and >
/// 0.
Eigen::Vector3i factors_for_spacing(const BeamGrid& beams, double spacing_mm);

}  // namespace usct
