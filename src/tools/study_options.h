#pragma once

#include <string>

#include "us_ct_registration/registration/registration.h"

namespace usct::tools {

/// The options that a study registers with: of a YAML file, or of a preset. Throws InputError if
/// both are given or the one given is unknown or invalid.
RegistrationOptions registration_options(const std::string& preset, const std::string& path);

}  // namespace usct::tools
