#pragma once

#include "registration/evidence/decoys.h"
#include "registration/evidence/local_agreement.h"
#include "registration/evidence/parts.h"

namespace usct::registration {

/// How far clusters of mirrored ultrasound agree with a pose that they share, of the decoy where
/// they agree most. An anatomy that is nearly symmetric lets mirrored ultrasound fit about as well
/// as a whole. Its clusters do not agree with each other as those at the right pose do.
///
/// Each decoy climbs by `fitted` from the pose that was found for it first, so that its clusters
/// are asked where it fits as exactly as the pose that it is compared with. `asked` is the
/// similarity of the clusters. `errors` are the greatest errors of the acquisition that a decoy may
/// climb to. Unset if no decoy has a local agreement.
std::optional<double> mirror_agreement(const std::vector<Decoy>& decoys, const Similarity& fitted,
                                       const Similarity& asked, const PartOptions& how,
                                       const AcquisitionErrors& errors,
                                       const LocalAgreementOptions& options,
                                       const FieldPoints& field, Run& run);

}  // namespace usct::registration
