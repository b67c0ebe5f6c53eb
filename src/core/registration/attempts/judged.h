#pragma once

#include <optional>
#include <vector>

#include "registration/evidence/evidence.h"

namespace usct::registration {

/// A pose that was judged, and the optima of its search.
struct Judged {
  /// First the one that the pose belongs to: it was refined to it, or the pose leads to it. Then
  /// the others, best first.
  std::vector<Candidate> optima;
  Candidate refined;
  Assessment assessment;
  /// Unset if the pose passes all gates.
  std::optional<GateFailure> failure;
};

}  // namespace usct::registration
