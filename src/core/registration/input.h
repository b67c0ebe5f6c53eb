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
};

}  // namespace usct::registration
