#pragma once

#include <optional>

#include "registration/search/candidates.h"
#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/similarity/similarity_images.h"

/// A wrong probe file, speed of sound or motor step stretches the recorded ultrasound. The images
/// show that: they fit better when they are stretched back.
namespace usct::registration {

/// The errors of the acquisition with which the ultrasound fits best near a pose, and what speaks
/// for them.
struct AcquisitionCheck {
  /// An error that the similarity cannot follow is 0. So is that of the depths, or those of the
  /// sweep, without which the ultrasound fits about as well as with all.
  AcquisitionErrors errors;
  /// The pose that goes with these errors.
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  /// Similarity with all errors over the most that a pose near by reaches without any.
  double ratio = 1.0;
  /// Student's t of the same comparison, patch by patch.
  double advantage = 0.0;
};

/// The greatest errors that are looked for: 15 %, or 0 if the similarity cannot follow an error.
AcquisitionErrors most_errors(const SimilarityOptions& similarity);

/// The same images, for similarities at poses with errors.
SimilarityImages with_beams(const SimilarityImages& images);

/// Looks for errors within 15 % by climbs over pose and errors, by half of the samples of
/// `similarity`. The errors are those of the optimum that `judged` is: if it is none, or if the
/// climb leaves it, there are none. Unset if the ultrasound has nothing that the similarity could
/// explain.
std::optional<AcquisitionCheck> check_acquisition(const Candidate& judged,
                                                  const SimilarityImages& images,
                                                  const SimilarityOptions& similarity,
                                                  const ConfidenceOptions& options,
                                                  const FieldPoints& field, Run& run);

/// The errors that were estimated, as far as the images show them.
struct ShownErrors {
  /// The estimated errors; none where noise may have shown them.
  AcquisitionErrors errors;

  /// Whether the depths are wrong by more than the bias of the estimate.
  bool has_wrong_depths() const;
  /// Whether the sweep is wrong on one side by more than the bias of the estimate.
  bool has_wrong_sweep() const;
  /// Whether the sweep is wrong and the depths are right. The kidney then lies where the pose puts
  /// it, but for the stretch of the sweep; with wrong depths it does not.
  bool are_of_sweep_alone() const;
};
ShownErrors shown_errors(const Measures& measures);

}  // namespace usct::registration
