#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// How far and how finely profiles go.
struct ProfileOptions {
  double reach_mm = 15.0;
  double reach_rad = 15.0 * kDegree;
  /// Offsets on either side of the pose.
  int steps = 20;

  /// Throws InputError, naming `source`, unless all are positive.
  void validate(const std::string& source = "profile options") const;
};

/// The similarity along one axis through a pose; NaN where it has no value.
struct SimilarityProfile {
  /// Translations in mm, or angles in rad, from the negative reach to the positive one.
  std::vector<double> offsets;
  std::vector<double> values;
};

/// Profiles of the similarity that places the pose in the end: that of the refinement or, without
/// one, of the last level of the search. The CT is moved from the pose `T_us_ct` by translations
/// along x, y and z of the US frame, and turned about these axes through `centre_us_mm`, in this
/// order. Both images are prepared as for a registration that starts at the pose.
///
/// Throws InputError as `register_ultrasound`, and with the reason if the images cannot be
/// registered (no overlap, ultrasound that does not vary).
std::array<SimilarityProfile, 6> similarity_profiles(const BeamUltrasound& ultrasound,
                                                     const CtVolume& ct,
                                                     const Eigen::Isometry3d& T_us_ct,
                                                     const Eigen::Vector3d& centre_us_mm,
                                                     const RegistrationOptions& options,
                                                     const ProfileOptions& profile = {});

}  // namespace usct
