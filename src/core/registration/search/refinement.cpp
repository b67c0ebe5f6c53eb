#include "registration/search/refinement.h"

namespace usct::registration {

Outcome<Candidate> refine(const ImagePyramid& images, const PreparedCt& ct,
                          const Candidate& optimum, const RegistrationOptions& options, Run& run) {
  if (!options.refinement) return optimum;
  const RefinementOptions& refinement = *options.refinement;
  Outcome<Level> level =
      run.timed("ct", [&] { return refinement_level(images, ct, optimum.T_us_ct, options); });
  if (!level) return level.refusal();
  return run.timed("refinement", [&]() -> Outcome<Candidate> {
    const Candidate refined =
        climbed(*level->similarity, {refinement.optimizer, refinement.reach_mm, {}, options.seed},
                images.prepared.field, {optimum.T_us_ct, optimum.errors}, run);
    if (!refined.has_value())
      return Refusal{RegistrationStatus::kNoOverlap, "CT and ultrasound do not overlap"};
    return refined;
  });
}

}  // namespace usct::registration
