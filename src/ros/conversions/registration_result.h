#pragma once

#include <us_ct_registration/RegistrationResult.h>

#include "us_ct_registration/registration/registration_result.h"

namespace usct::ros_interface {

/// Fills the fields that the core knows: status, transform, covariance, candidates, measures,
/// durations and so on. The node fills frames, stamps, ids and the fixed frame.
us_ct_registration::RegistrationResult to_message(const RegistrationResult& result);

}  // namespace usct::ros_interface
