#pragma once

#include <Eigen/Core>

#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct {

/// Ultrasound with fewer samples, lines and frames: each new sample is the mean of the known
/// samples of a block and lies in the middle of the block (on the mean beam of the block). A block
/// of which less than half is known is unknown. An incomplete block at the end of an axis is left
/// out.
///
/// `factors` are the samples, lines and frames per block. Throws InputError if a factor is < 1 or
/// greater than the size of its axis.
BeamUltrasound decimate(const BeamUltrasound& ultrasound, const Eigen::Vector3i& factors);

/// The factors whose blocks have edges closest to `spacing_mm`. The spacing of lines is measured in
/// the middle frame and that of frames on the middle line, both at the middle depth. Factors are at
/// least 1, and at most half of the size, so that each axis keeps two blocks. Throws InputError
/// unless the spacing is finite and > 0.
Eigen::Vector3i factors_for_spacing(const BeamGrid& beams, double spacing_mm);

}  // namespace usct
