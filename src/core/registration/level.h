#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/similarity/similarity.h"
#include "us_ct_registration/volume/operations.h"

/// What the stages of a registration look at: both images, prepared.
namespace usct::registration {

/// Ultrasound as all stages see it: conditioned; `known` where it counts.
struct PreparedUltrasound {
  BeamUltrasound us;
  /// Some of the positions that count, evenly taken, US mm: what displacements are judged by.
  std::vector<Eigen::Vector3d> points_us_mm;
};

/// `check` is called between the parts of the work and may throw to cancel; so below.
PreparedUltrasound prepare_ultrasound(const BeamUltrasound& ultrasound,
                                      const RegistrationOptions& options,
                                      const Progress& check = {});

/// The part of the CT that the ultrasound can reach: its field of view at the initial pose, moved
/// and turned as far as the starts go. Of size 0 where there is none.
struct CtInReach {
  const CtVolume& ct;
  Region region;
};

CtInReach ct_in_reach(const CtVolume& ct, const BeamGrid& beams,
                      const Eigen::Isometry3d& T_us_ct_initial, const RegistrationOptions& options);

/// The CT of each stage, averaged to its spacing, coarse ones from fine ones. Empty for stages that
/// simulate: they take the CT as it is.
std::vector<Volume<float>> ct_levels(const CtInReach& in_reach, const RegistrationOptions& options,
                                     const Progress& check = {});

/// The similarity of a stage, and on request another one on the same images.
struct Level {
  std::shared_ptr<const Similarity> similarity;
  std::shared_ptr<const Similarity> confirmation;
};

Level make_level(const StageOptions& stage, const PreparedUltrasound& prepared,
                 const CtInReach& in_reach, const Volume<float>& ct, bool with_confirmation,
                 const RegistrationOptions& options);

}  // namespace usct::registration
