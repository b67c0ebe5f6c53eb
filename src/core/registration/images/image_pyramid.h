#pragma once

#include <memory>
#include <vector>

#include "registration/images/ct_in_reach.h"
#include "registration/images/prepared_ultrasound.h"
#include "registration/input.h"
#include "registration/outcome.h"
#include "registration/run.h"
#include "us_ct_registration/registration/prepared_ct.h"
#include "us_ct_registration/similarity/similarity_images.h"

/// Both images as the search uses them: the ultrasound conditioned, the CT cropped to the part that
/// the search can reach, and both averaged level by level.
namespace usct::registration {

/// A similarity on images of one resolution.
struct Level {
  std::shared_ptr<SimilarityImages> images;
  std::shared_ptr<const Similarity> similarity;
  /// The same by a part of the samples, where the search screens with it; else null.
  std::shared_ptr<const Similarity> screening;
};

struct ImagePyramid {
  PreparedUltrasound prepared;
  CtInReach in_reach;
  /// The levels of SearchOptions::levels, in their order.
  std::vector<Level> levels;

  const Similarity& deciding() const { return *levels.back().similarity; }
};

/// The first step of a registration. Frames of a tracked probe at rest count as one. Refuses
/// ultrasound without samples that count or vary, a CT that is nowhere near it, an initial pose
/// that is not finite, and options that allow no evaluation. Throws InputError for images and
/// options that are malformed, and for an initial pose that is not rigid.
Outcome<ImagePyramid> prepare(const RegistrationInput& input, Run& run);

/// The level of the refinement, on the CT around a pose. It uses the images of the deciding level
/// if they have the same spacing. Refuses a CT that does not overlap.
Outcome<Level> refinement_level(const ImagePyramid& images, const PreparedCt& ct,
                                const Eigen::Isometry3d& T_us_ct,
                                const RegistrationOptions& options);

}  // namespace usct::registration
