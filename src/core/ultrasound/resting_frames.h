#pragma once

#include <optional>

#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct {

/// Frames of a tracked sweep count as one while no corner of the field of view is farther than this
/// from where the first of them has it, mm: half of the spacing of conditioned ultrasound.
constexpr double kRestMm = 0.5;

/// Averages the frames of a tracked sweep that follow each other while the probe rests, or moves
/// slowly. A probe takes as many frames in a second wherever it is, so that the tissue where it
/// rests would have more of a say in all sums over frames than the rest of the field, and the mean
/// distance between frames would not be that of frames which move.
///
/// Each beam is the mean beam of its group, and each sample the mean of its known samples; it is
/// unknown if less than half of them are known. Frames that rest with no other keep their bits.
/// Nothing is returned if no frames rest together, or the sweep is that of a motor. The ultrasound
/// must be valid.
std::optional<BeamUltrasound> without_resting_frames(const BeamUltrasound& ultrasound);

/// The number of frames that a tracked sweep would have if the probe had never rested, but moved at
/// the pace of its other frames. Groups of frames that are averaged count as rest if they have more
/// than twice as many frames as the median. All frames of a motor's sweep.
int moving_frames(const BeamGrid& beams);

}  // namespace usct
