#pragma once

#include <optional>
#include <vector>

#include "registration/evidence/decoys.h"

/// A trail is what an accepted registration hands on to the next one of the same CT and probe: its
/// pose, and the poses that it was compared with.
namespace usct::registration {

struct Trail {
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  std::vector<Decoy> decoys;
  /// As `rivals_of` finds them, best first.
  std::vector<Candidate> rivals;
  /// The errors of the sweep that were taken out of the ultrasound, and are out of the next one.
  AcquisitionErrors corrected;
};

/// Optima and decoys of new ultrasound at the deciding level.
struct Followed {
  /// The tracked pose, and its rivals, best first.
  std::vector<Candidate> optima;
  std::vector<Decoy> decoys;
};

/// Follows the trail to the initial pose of `problem`: the motion from the trail's pose to that one
/// is taken for a motion of the probe, which moves all poses of the trail alike. Poses and decoys
/// are climbed again, each decoy from the tracked pose as well. Nothing if the tracked pose has no
/// similarity, or a rival is more similar.
std::optional<Followed> follow(const Trail& trail, const SearchProblem& problem,
                               const BeamGrid& beams, const ConfidenceOptions& confidence,
                               Run& run);

}  // namespace usct::registration
