#pragma once

#include <optional>
#include <vector>

#include "registration/evidence/evidence.h"

namespace usct::registration {

/// A pose that was judged, and the optima among which the search found it.
struct Judged {
  /// Best first; the pose is the refinement of the first one.
  std::vector<Candidate> optima;
  Candidate refined;
  Assessment assessment;
  /// Unset if the pose passes all gates.
  std::optional<GateFailure> failure;
};

/// Completes the measures of a pose by those that need no evidence.
void measure_pose(const FieldPoints& field, const Eigen::Isometry3d& T_us_ct_initial,
                  const Candidate& optimum, const Candidate& refined, Measures& measures);

}  // namespace usct::registration
