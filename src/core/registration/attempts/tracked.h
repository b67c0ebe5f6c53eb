#pragma once

#include <optional>

#include "registration/attempts/attempt.h"
#include "registration/attempts/registered.h"

namespace usct::registration {

/// A trail that a registration follows first, unless its initial pose is over `reach_mm` from the
/// trail's.
struct Lead {
  const Trail& trail;
  double reach_mm;
};

/// The pose that the trail leads to, if it is to be believed without a search.
std::optional<Registration> tracked(const Attempt& attempt, const Lead& lead);

}  // namespace usct::registration
