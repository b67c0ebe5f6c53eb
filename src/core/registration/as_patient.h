#pragma once

#include "us_ct_registration/registration/registration_options.h"

namespace usct::registration {

/// The options of the preset `patient` with what holds for it as well of other options: seed,
/// rounds, `correct_sweep`, starts as far away as theirs, and their confidence. The two
/// similarities of that stay those of `patient`, unless the other options ask for its evidence.
RegistrationOptions as_patient(const RegistrationOptions& of);

}  // namespace usct::registration
