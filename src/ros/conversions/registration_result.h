#pragma once

#include <us_ct_registration/RegistrationResult.h>

#include "us_ct_registration/registration/registration_result.h"

namespace usct::ros_interface {

/// Fills what the core knows: status, transform, covariance, candidates, measures, durations...;
/// frames, stamps, ids and the fixed frame are the node's.
us_ct_registration::RegistrationResult to_message(const RegistrationResult& result);

}  // namespace usct::ros_interface
