#pragma once

#include "registration/attempts/attempt.h"
#include "registration/attempts/registered.h"

namespace usct::registration {

/// The pose that all rounds of the search find, judged by the evidence that the preset `patient`
/// gathers for it on images of its own.
Outcome<Registration> judged_as_patient(const Attempt& attempt);

}  // namespace usct::registration
