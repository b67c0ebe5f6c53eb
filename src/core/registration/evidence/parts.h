#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "registration/search/candidates.h"
#include "us_ct_registration/similarity/similarity_images.h"

/// Parts of the ultrasound: the pose found again from halves of the field of view. Halves share no
/// tissue, so that they disagree where the pose is wrong, the anatomy is another one, or it moved
/// or deformed; odd and even frames would share noise.
namespace usct::registration {

/// The poses that the halves of the field lead to: of the lines, and of the frames in the order of
/// their places along the sweep.
struct HalfPoses {
  Eigen::Isometry3d left, right;
  Eigen::Isometry3d first, last;

  std::vector<Eigen::Isometry3d> all() const { return {left, right, first, last}; }
};

/// Climbs from the pose on each half of the images, by each of the similarities for itself: an
/// entry for each. Unset if a half has nothing that the similarity could explain.
std::vector<std::optional<HalfPoses>> poses_of_halves(
    const SimilarityImages& images, const std::vector<SimilarityOptions>& similarities,
    const PartOptions& options, const Eigen::Isometry3d& T_us_ct, const FieldPoints& field,
    Run& run);

}  // namespace usct::registration
