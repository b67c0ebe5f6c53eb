#pragma once

#include "registration/attempts/judged.h"
#include "registration/outcome.h"

namespace usct::registration {

/// The result of a registration that found something: with a transform only if no gate failed.
RegistrationResult result_of(const Judged& judged);

/// Tells which errors of the sweep were taken out of the ultrasound before it was registered, and
/// adds them to those that were still found. Does nothing if there are none.
void tell_corrected_sweep(const AcquisitionErrors& errors, RegistrationResult& result);

/// Tells which of a sweep's frames, at least one, were left out before it was registered.
void tell_stray_frames(const std::vector<int>& frames, int of_frames, RegistrationResult& result);

/// The result of a registration that could not go on.
RegistrationResult result_of(const Refusal& refusal);

}  // namespace usct::registration
