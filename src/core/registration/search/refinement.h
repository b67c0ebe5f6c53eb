#pragma once

#include "registration/images/image_pyramid.h"

/// The refinement of the best optimum.
namespace usct::registration {

/// Climbs from an optimum of the search on finer images around it, as RefinementOptions say.
/// Without a refinement the optimum itself is returned. Refuses if CT and ultrasound do not
/// overlap.
Outcome<Candidate> refine(const ImagePyramid& images, const PreparedCt& ct,
                          const Candidate& optimum, const RegistrationOptions& options, Run& run);

}  // namespace usct::registration
