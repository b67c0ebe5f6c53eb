#pragma once

#include "registration/attempts/registered.h"
#include "registration/outcome.h"

namespace usct::registration {

/// Whether the pose is accepted on ultrasound with a corrected sweep, and the images no longer show
/// a wrong one.
bool shows_right_sweep(const Outcome<Registration>& corrected);

/// Whether a correction of the sweep holds: that, and the ultrasound is more similar to the CT than
/// as it was recorded. In a mirrored CT a wrong pose leads to a correction by which this pose
/// passes, since its mirror images lose more by it than the pose does. Values of two different
/// similarities say nothing of each other.
bool correction_holds(const Registration& recorded, const Outcome<Registration>& corrected);

}  // namespace usct::registration
