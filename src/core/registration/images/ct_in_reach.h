#pragma once

#include <Eigen/Geometry>

#include "registration/images/prepared_ultrasound.h"
#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/volume/operations.h"

namespace usct::registration {

/// A part of a CT; of size 0 if nothing is in reach. The CT must outlive it.
struct CtInReach {
  const CtVolume& ct;
  Region region;
};

/// The part that the search can reach from the initial pose: see SearchOptions::ct_margin_mm.
CtInReach ct_in_reach(const CtVolume& ct, const BeamGrid& beams,
                      const Eigen::Isometry3d& T_us_ct_initial, const SearchOptions& options);

/// The part that the ultrasound reaches from a pose if its points move by `margin_mm` at most.
CtInReach ct_around(const CtVolume& ct, const PreparedUltrasound& prepared,
                    const Eigen::Isometry3d& T_us_ct, double margin_mm);

}  // namespace usct::registration
