#pragma once

#include "us_ct_registration/registration/registration_options.h"

namespace usct::registration {

/// The images, the search and the evidence of the preset `patient`, for a registration by other
/// options: with their gates, their rounds and their seed, and with starts as far away as theirs.
RegistrationOptions as_patient(const RegistrationOptions& of);

/// Whether a registration by these options goes on as the preset `patient` where its own evidence
/// leaves doubt.
bool may_go_on_as_patient(const RegistrationOptions& options);

}  // namespace usct::registration
