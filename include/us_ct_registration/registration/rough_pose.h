#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/geometry/grid.h"

namespace usct {

/// Where the probe's axes point in the patient, LPS, unit length, at right angles to each other.
struct ProbeDirection {
  Eigen::Vector3d axial = Eigen::Vector3d::UnitY();    // posterior
  Eigen::Vector3d lateral = Eigen::Vector3d::UnitX();  // left
};

/// Two words, for the axial and the lateral axis, of left, right, anterior, posterior, superior and
/// inferior. Throws InputError, naming `source`, for anything else and unless they are at right
/// angles.
ProbeDirection parse_probe_direction(const std::vector<std::string>& words,
                                     const std::string& source);

/// Where a search over all poses begins: the probe looks as said, and the middle of the CT lies in
/// the middle of the ultrasound. `T_us_ct`, mm.
Eigen::Isometry3d rough_pose(const Grid& ct, const BeamGrid& beams,
                             const ProbeDirection& direction);

/// Mean of the middles of all beams, US frame, mm.
Eigen::Vector3d middle_mm(const BeamGrid& beams);

}  // namespace usct
