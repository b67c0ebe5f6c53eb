#pragma once

#include <us_ct_registration/RegistrationResult.h>

#include <string>

#include "us_ct_registration/registration/registration_result.h"

namespace usct::ros_interface {

/// Fills the fields that the core knows: status, transform, covariance, candidates, measures,
/// durations and so on. The node fills frames, stamps, ids and the fixed frame.
us_ct_registration::RegistrationResult to_message(const RegistrationResult& result);

/// The inverse of `to_message`, without covariance and durations. A code of missing or invalid
/// input is RegistrationStatus::kFailed. Throws InputError, naming `source`, if a transform is not
/// rigid or a measure is not known.
RegistrationResult registration_result_from(const us_ct_registration::RegistrationResult& message,
                                            const std::string& source);

}  // namespace usct::ros_interface
