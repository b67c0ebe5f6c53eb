#pragma once

#include <string>

#include "us_ct_registration/registration/registration_result.h"

namespace usct::tools {

/// Lines for people about how far a result can be trusted, each with its end of line. Of a
/// registered result they give the probability that it is wrong, the expected error and its bound;
/// of a refused one the probability, and what each kind of evidence says, with what would help
/// where it speaks against the pose. Empty if no pose was found.
std::string confidence_text(const RegistrationResult& result);

}  // namespace usct::tools
