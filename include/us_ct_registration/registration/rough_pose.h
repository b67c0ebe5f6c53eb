#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/geometry/grid.h"

namespace usct {

/// Directions of the probe's axes in the patient, LPS, of unit length and perpendicular to each
/// other.
struct ProbeDirection {
  Eigen::Vector3d axial = Eigen::Vector3d::UnitY();    // posterior
  Eigen::Vector3d lateral = Eigen::Vector3d::UnitX();  // left
};

/// Parses two words, for the axial and the lateral axis, each one of left, right, anterior,
/// posterior, superior and inferior. Throws InputError, naming `source`, for any other word and
/// unless the axes are at right angles.
ProbeDirection parse_probe_direction(const std::vector<std::string>& words,
                                     const std::string& source);

/// Initial pose where none is known, as for the preset `global`: the probe looks in the given
/// direction, and the centre of the CT lies at the centre of the ultrasound. `T_us_ct`, mm.
Eigen::Isometry3d rough_pose(const Grid& ct, const BeamGrid& beams,
                             const ProbeDirection& direction);

}  // namespace usct
