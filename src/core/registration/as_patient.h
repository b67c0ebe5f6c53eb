#pragma once

#include "us_ct_registration/registration/registration_options.h"

namespace usct::registration {

/// The options of the preset `patient` with the gates, the rounds and the seed of other options,
/// and with starts as far away as theirs.
RegistrationOptions as_patient(const RegistrationOptions& of);

}  // namespace usct::registration
