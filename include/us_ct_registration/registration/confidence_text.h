#pragma once

#include <string>

#include "us_ct_registration/registration/registration_result.h"

/// The confidence in a registration, in words for people. Each line has its end of line.
namespace usct {

/// The evidence for and against a pose, kind by kind, with what would help where it does not speak
/// for the pose; or that there is no evidence.
std::string evidence_text(const Measures& measures);

/// Lines that say how far a result can be trusted. A registered result has the probability that it
/// is wrong, the expected error and its bound; a refused one has the probability, and
/// `evidence_text`. Empty if no pose was found.
std::string confidence_text(const RegistrationResult& result);

}  // namespace usct
