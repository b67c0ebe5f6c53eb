#pragma once

#include "registration/image_pyramid.h"

/// The last fraction of a millimetre.
namespace usct::registration {

/// Climbs from an optimum of the search on finer images around it, as RefinementOptions say.
/// Without a refinement the optimum itself is the outcome. Refuses where CT and ultrasound do not
/// overlap.
Outcome<Candidate> refine(const ImagePyramid& images, const CtVolume& ct, const Candidate& optimum,
                          const RegistrationOptions& options, Run& run);

}  // namespace usct::registration
