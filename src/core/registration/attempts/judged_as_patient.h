#pragma once

#include "registration/attempts/attempt.h"
#include "registration/attempts/registered.h"

namespace usct::registration {

/// Each round searches, and judges what it finds by the evidence that the preset `patient` gathers
/// on images of its own, until the pose passes the gates, or the evidence says that another round
/// would not help.
Outcome<Registration> judged_as_patient(const Attempt& attempt);

}  // namespace usct::registration
