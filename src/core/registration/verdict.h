#pragma once

#include "registration/assessment.h"
#include "registration/outcome.h"

namespace usct::registration {

/// The result of a registration that found something: with a transform only if no gate failed.
RegistrationResult result_of(const std::vector<Candidate>& optima, const Candidate& refined,
                             const Assessment& assessment,
                             const std::optional<GateFailure>& failure);

/// The result of a registration that could not go on.
RegistrationResult result_of(const Refusal& refusal);

}  // namespace usct::registration
