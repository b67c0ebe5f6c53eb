#pragma once

#include <optional>

#include "registration/attempts/attempt.h"
#include "registration/attempts/registered.h"

/// Attempts that search in rounds, and judge by evidence from their own images.
namespace usct::registration {

/// Each round searches, refines, assesses and judges, until the pose passes the gates, or the
/// evidence says that another round would not help. After the first round blocks of the
/// ultrasound are matched, see BlockSearch; their pose is the result if it passes, or if no pose
/// does and it is less likely to be wrong.
Outcome<Registration> in_rounds(const Attempt& attempt);

/// The pose of the first round, if it is to be believed without further search.
std::optional<Registration> at_once(const Attempt& attempt);

}  // namespace usct::registration
