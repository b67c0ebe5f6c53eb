#include "registration/evidence/mirror_agreement.h"

#include <algorithm>

#include "parallel.h"

namespace usct::registration {
namespace {

/// The pose at which the mirrored ultrasound fits best, near the one that was found for it.
Candidate fitted_pose(const Decoy& decoy, const Similarity& fitted, const PartOptions& how,
                      const AcquisitionErrors& errors, const FieldPoints& field, Run& run) {
  const MirroredSimilarity mirrored(fitted, decoy.T_mirror);
  return climbed(mirrored, {how.optimizer, how.reach_mm, errors}, field, {decoy.best.T_us_ct, {}},
                 run);
}

}  // namespace

std::optional<double> mirror_agreement(const std::vector<Decoy>& decoys, const Similarity& fitted,
                                       const Similarity& asked, const PartOptions& how,
                                       const AcquisitionErrors& errors,
                                       const LocalAgreementOptions& options,
                                       const FieldPoints& field, Run& run) {
  std::vector<Candidate> poses(decoys.size());
  parallel_for(static_cast<int>(decoys.size()), [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    poses[at] = fitted_pose(decoys[at], fitted, how, errors, field, run);
  });
  std::optional<double> most;
  for (std::size_t i = 0; i < decoys.size(); ++i) {
    const std::optional<LocalAgreement> found =
        local_agreement(MirroredSimilarity(asked, decoys[i].T_mirror), poses[i], options, run);
    if (found) most = std::max(most.value_or(found->share), found->share);
  }
  return most;
}

}  // namespace usct::registration
