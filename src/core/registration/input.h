#pragma once

#include <Eigen/Geometry>

#include "us_ct_registration/registration/registration.h"

namespace usct::registration {

/// Images, initial pose and options of a registration. All must outlive the steps that take it.
struct RegistrationInput {
  const BeamUltrasound& ultrasound;
  const PreparedCt& ct;
  const Eigen::Isometry3d& T_us_ct_initial;
  const RegistrationOptions& options;

  /// The same of other ultrasound, and by other options.
  RegistrationInput on(const BeamUltrasound& other) const {
    return {other, ct, T_us_ct_initial, options};
  }
  RegistrationInput by(const RegistrationOptions& other) const {
    return {ultrasound, ct, T_us_ct_initial, other};
  }
};

}  // namespace usct::registration
