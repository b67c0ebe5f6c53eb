#pragma once

#include <Eigen/Core>

#include "us_ct_registration/geometry/beam_grid.h"

namespace usct::registration {

/// Orthogonal directions of a field of view, US frame, unit length.
struct FieldAxes {
  Eigen::Vector3d axial;      // mean direction of the beams
  Eigen::Vector3d lateral;    // from the first line to the last one
  Eigen::Vector3d elevation;  // across both
};

FieldAxes field_axes(const BeamGrid& beams);

}  // namespace usct::registration
