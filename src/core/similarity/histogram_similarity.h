#pragma once

#include <memory>

#include "us_ct_registration/similarity/patch_similarity.h"

/// The similarities that are made of histograms over all samples: see make_patch_similarity.
namespace usct {

/// kMattesMi or kNmi.
std::shared_ptr<const Similarity> make_mutual_information(
    std::shared_ptr<const UltrasoundPatches> ultrasound, std::shared_ptr<const PackedCt> ct,
    const SimilarityOptions& options);

std::shared_ptr<const Similarity> make_correlation_ratio(
    std::shared_ptr<const UltrasoundPatches> ultrasound, std::shared_ptr<const PackedCt> ct,
    const SimilarityOptions& options);

std::shared_ptr<const Similarity> make_joint_correlation_ratio(
    std::shared_ptr<const UltrasoundPatches> ultrasound, std::shared_ptr<const PackedCt> ct,
    const SimilarityOptions& options);

}  // namespace usct
