#pragma once

#include <Eigen/Geometry>

namespace usct::registration {

/// The motion that applies a linear map, of rotation or reflection, about a centre.
inline Eigen::Isometry3d motion_about(const Eigen::Vector3d& centre,
                                      const Eigen::Matrix3d& linear) {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = linear;
  motion.translation() = centre - linear * centre;
  return motion;
}

}  // namespace usct::registration
