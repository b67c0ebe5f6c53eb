#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <utility>
#include <vector>

#include "us_ct_registration/progress.h"
#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/similarity/packed_ct.h"
#include "us_ct_registration/similarity/patch_similarity.h"
#include "us_ct_registration/similarity/similarity.h"
#include "us_ct_registration/similarity/ultrasound_patches.h"
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

/// The part that it reaches from a pose if its points move by `margin_mm` at most.
CtInReach ct_around(const CtVolume& ct, const PreparedUltrasound& prepared,
                    const Eigen::Isometry3d& T_us_ct, double margin_mm);

/// The CT of the stages [0, count), averaged to their spacing, coarse ones from fine ones. Empty
/// for stages that simulate: they take the CT as it is. `check` may throw to cancel.
std::vector<Volume<float>> ct_levels(const CtInReach& in_reach, const RegistrationOptions& options,
                                     std::size_t count, const Progress& check = {});

/// The CT of one stage, likewise.
Volume<float> ct_level(const CtInReach& in_reach, const StageOptions& stage);

/// What the similarities of a stage look at: ultrasound and CT, averaged to the stage's spacing.
class LevelImages {
 public:
  /// `prepared` must outlive it; `ct` need not.
  LevelImages(const StageOptions& stage, const PreparedUltrasound& prepared,
              const Volume<float>& ct, const RegistrationOptions& options);

  /// Shares patches with the others that cut the ultrasound into the same ones.
  std::shared_ptr<const Similarity> similarity(const SimilarityOptions& options);

 private:
  const BeamUltrasound& us() const { return averaged_.brightness.empty() ? us_ : averaged_; }

  const BeamUltrasound& us_;
  BeamUltrasound averaged_;  // empty if the stage looks at `us_`
  std::shared_ptr<const PackedCt> ct_;
  PatchContents contents_;
  std::vector<std::pair<PatchOptions, std::shared_ptr<const UltrasoundPatches>>> patches_;
};

/// The similarity of a stage, and for the decisive one another on the same images.
struct Level {
  std::shared_ptr<LevelImages> images;  // none where the stage simulates
  std::shared_ptr<const Similarity> similarity;
  std::shared_ptr<const Similarity> confirmation;
};

/// `ct` is that of the stage, `in_reach` what stages that simulate take.
Level make_level(const StageOptions& stage, const PreparedUltrasound& prepared,
                 const CtInReach& in_reach, const Volume<float>& ct, bool with_confirmation,
                 const RegistrationOptions& options);

/// Whether a stage can look at the images of another.
bool shares_images(const StageOptions& stage, const StageOptions& other);

}  // namespace usct::registration
