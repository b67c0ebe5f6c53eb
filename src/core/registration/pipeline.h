#pragma once

#include "registration/attempts/tracked.h"

namespace usct::registration {

/// The pipeline of `register_ultrasound`: which attempts are made, on which images, and which of
/// them has the result. With a lead its trail is followed first; the search begins if that finds no
/// pose that is accepted. With EvidenceSource::kOwnFirst, the first round ends the registration if
/// its pose is beyond doubt; else the result is that of the preset `patient`.
Registration run_pipeline(const RegistrationInput& input, const RegistrationHooks& hooks,
                          const Lead* lead = nullptr);

}  // namespace usct::registration
