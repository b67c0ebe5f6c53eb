#pragma once

#include <Eigen/Core>

#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct {

/// Averages ultrasound over blocks of samples, lines and frames. Each value is the mean of the
/// known samples of a block, and lies in the middle of the block, on its mean beam. A block is
/// unknown if less than half of it is known. An incomplete last block is dropped.
///
/// `factors`: samples, lines and frames per block, >= 1. Throws InputError if one is not, or
/// exceeds the number of samples, lines or frames.
BeamUltrasound decimate(const BeamUltrasound& ultrasound, const Eigen::Vector3i& factors);

/// Sizes of blocks whose edges come closest to `spacing_mm`. The distance of neighbouring lines is
/// taken in the middle of the depths in the middle frame; that of neighbouring frames in the middle
/// of the depths on the middle line, or, if a tracked probe hardly moves the field there, at the
/// median of places that are spread over it. Each size is at least 1, and at most half of the
/// samples, lines or frames, so that every axis keeps two blocks. Throws InputError unless the
/// spacing is finite and > 0.
Eigen::Vector3i factors_for_spacing(const BeamGrid& beams, double spacing_mm);

}  // namespace usct
