#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "us_ct_registration/phantom/anatomy.h"
#include "us_ct_registration/progress.h"
#include "us_ct_registration/volume/volume.h"

/// Formation of a CT from an anatomy.
namespace usct::phantom {

struct CtOptions {
  /// Voxels and their spacing along the patient's left, posterior and superior axes, whatever the
  /// storage order; thesis 3.1.2.
  Eigen::Vector3i size{320, 220, 110};
  Eigen::Vector3d spacing_mm{0.468, 0.468, 1.0};
  /// Storage order: the directions of the index axes, each L or R, P or A, S or I.
  std::string axes = "LPS";
  /// Rotation of the grid about its centre, degrees, about x, then y, then z.
  Eigen::Vector3d oblique_deg = Eigen::Vector3d::Zero();
  /// Standard deviation of the noise, HU; [0, 200].
  double noise_hu = 14.0;
  /// Full width at half maximum of the point spread, in the axial plane and across it, mm; [0, 5].
  double in_plane_fwhm_mm = 0.9;
  double slice_fwhm_mm = 1.1;

  void validate() const;
};

/// The grid of such a CT around a centre.
Grid ct_grid(const CtOptions& options, const Eigen::Vector3d& centre_mm);

/// The tissue at the centre of every voxel.
LabelVolume form_labels(const Anatomy& anatomy, const Grid& grid, const Progress& progress = {});

/// CT on the grid of `labels` (made by `form_labels` of the same anatomy): partial volume by
/// supersampling where tissues meet, texture, the scanner's point spread (fixed to the patient's
/// axes, whatever the grid's), noise with the band-pass spectrum that filtered back-projection
/// leaves, whole HU in [-1024, 3071].
CtVolume form_ct(const Anatomy& anatomy, const TissueTable& tissues, const LabelVolume& labels,
                 const CtOptions& options, std::uint64_t seed, const Progress& progress = {});

/// Adds noise as `form_ct` does.
void add_ct_noise(CtVolume& ct, double noise_hu, std::uint64_t seed);

}  // namespace usct::phantom
