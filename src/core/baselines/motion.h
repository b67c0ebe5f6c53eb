#pragma once

#include <Eigen/Geometry>

#include "us_ct_registration/geometry/rigid.h"

namespace usct {

/// The transform that shifts a point `centre_mm` and turns about it; the turn is a rotation vector.
inline Eigen::Isometry3d motion_about(const Eigen::Vector3d& centre_mm,
                                      const Eigen::Vector3d& shift_mm,
                                      const Eigen::Vector3d& turn_rad) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = rotation_from_vector(turn_rad);
  T.translation() = centre_mm + shift_mm - T.linear() * centre_mm;
  return T;
}

}  // namespace usct
