#pragma once

#include <optional>

#include "registration/candidates.h"
#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/similarity/similarity_images.h"

/// A wrong probe file, speed of sound or motor step stretches the recorded ultrasound. The images
/// show that: they fit better when they are stretched back.
namespace usct::registration {

/// The errors of the acquisition with which the ultrasound fits best near a pose, within 15 %: one
/// climb over pose and errors, by half of the samples of `similarity`. An error that the similarity
/// cannot follow is 0. Unset if the ultrasound has nothing that the similarity could explain.
std::optional<AcquisitionErrors> acquisition_errors_at(const Eigen::Isometry3d& T_us_ct,
                                                       const SimilarityImages& images,
                                                       const SimilarityOptions& similarity,
                                                       const PartOptions& how,
                                                       const FieldPoints& field, Run& run);

}  // namespace usct::registration
