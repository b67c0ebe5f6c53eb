#pragma once

#include <Eigen/Geometry>

namespace usct {

/// The transform that shifts a point `centre_mm` and turns about it; the turn is a rotation vector.
inline Eigen::Isometry3d motion_about(const Eigen::Vector3d& centre_mm,
                                      const Eigen::Vector3d& shift_mm,
                                      const Eigen::Vector3d& turn_rad) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  if (turn_rad.norm() > 0.0)
    T.linear() = Eigen::AngleAxisd(turn_rad.norm(), turn_rad.normalized()).matrix();
  T.translation() = centre_mm + shift_mm - T.linear() * centre_mm;
  return T;
}

}  // namespace usct
