#include "registration/acquisition_check.h"

#include "us_ct_registration/similarity/catalogue.h"

namespace usct::registration {

std::optional<AcquisitionErrors> acquisition_errors_at(const Eigen::Isometry3d& T_us_ct,
                                                       const SimilarityImages& images,
                                                       const SimilarityOptions& similarity,
                                                       const PartOptions& how,
                                                       const FieldPoints& field, Run& run) {
  constexpr double kMostError = 0.15;
  // In mm and per cent: an error that matters lies several per cent away, along a flat ridge.
  constexpr double kStep = 4.0;
  const SimilarityNeeds needs = needs_of(similarity);
  if (!needs.patches) return std::nullopt;
  SimilarityImages with_beams(std::make_shared<const BeamUltrasound>(images.ultrasound()),
                              images.packed_ct(), nullptr, true, images.backend());
  const std::shared_ptr<const Similarity> stretched =
      make_similarity(with_beams, on_samples(similarity, SampleSubset::kHalf));
  if (!stretched) return std::nullopt;
  std::vector<Candidate> found{{T_us_ct, {}}};
  evaluate(*stretched, found, run);
  const AcquisitionErrors limits{needs.follows_depth_error ? kMostError : 0.0,
                                 needs.follows_sweep_error ? kMostError : 0.0};
  OptimizerOptions optimizer = how.optimizer;
  optimizer.initial_step = kStep;
  climb(*stretched, {optimizer, how.reach_mm, limits, 1}, field, found, run);
  return found.front().errors;
}

}  // namespace usct::registration
