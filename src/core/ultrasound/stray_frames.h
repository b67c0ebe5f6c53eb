#pragma once

#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct {

/// A frame that lies farther than this from frames before and after it, which lie nearer to each
/// other, is off the probe's path, mm. Frames that lie less off do no harm that can be measured.
constexpr double kStrayMm = 20.0;
/// The frames follow no path if a larger share of them is off it.
constexpr double kMostStrayShare = 0.1;

/// The frames of a tracked sweep whose poses cannot be right, in ascending order: each has a corner
/// of the field of view farther than kStrayMm, and the way that the probe goes meanwhile at its
/// step between the other frames, from where most of the three frames before it and the three after
/// it have theirs, of which some before and some after lie nearer to each other. A tracker gives
/// such poses for an instant, from a reflection or a marker that is half hidden. None is a jump
/// after which the probe goes on elsewhere, or a probe that moves fast.
///
/// None if more than kMostStrayShare of the frames lie so, as where their order is not that of a
/// path, or if the sweep is that of a motor. The beams must be valid.
std::vector<int> stray_frames(const BeamGrid& beams);

/// The stray frames of ultrasound, and the ultrasound without them if there are any.
struct FramesOnPath {
  std::vector<int> stray;
  std::optional<BeamUltrasound> others;
};

/// Finds them. Throws InputError if the ultrasound is malformed, or another of its frames jumps
/// (require_no_jump).
FramesOnPath frames_on_path(const BeamUltrasound& ultrasound);

/// Says how many of a sweep's frames are stray, which comes first, and why, for messages.
std::string stray_words(const std::vector<int>& stray, int frames);

/// The ultrasound without these frames, which must be in ascending order and not all frames.
BeamUltrasound without_frames(const BeamUltrasound& ultrasound, const std::vector<int>& frames);

}  // namespace usct
