#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/geometry/random_geometry.h"

namespace usct::test {

inline Eigen::Vector3d random_vector(double bound) {
  return {uniform(-bound, bound), uniform(-bound, bound), uniform(-bound, bound)};
}

inline Eigen::Vector3d random_direction() {
  return (random_vector(1.0) + Eigen::Vector3d(1e-3, 0.0, 0.0)).normalized();
}

/// Points that do not lie on a line, of unequal extent along the axes.
inline std::vector<Eigen::Vector3d> random_points() {
  const Eigen::Vector3d centre = random_vector(150.0);
  const Eigen::Vector3d extent(uniform(5.0, 20.0), uniform(20.0, 50.0), uniform(10.0, 80.0));
  std::vector<Eigen::Vector3d> points;
  for (int i = integer(6, 40); i > 0; --i)
    points.push_back(centre + random_vector(1.0).cwiseProduct(extent));
  points.push_back(centre + Eigen::Vector3d(extent.x(), 0.0, 0.0));
  points.push_back(centre + Eigen::Vector3d(0.0, extent.y(), 0.0));
  return points;
}

inline std::vector<Eigen::Vector3d> moved(const Eigen::Isometry3d& T,
                                          std::vector<Eigen::Vector3d> points) {
  for (Eigen::Vector3d& point : points) point = T * point;
  return points;
}

inline std::vector<Eigen::Vector3d> cube_corners(double half_edge_mm) {
  std::vector<Eigen::Vector3d> corners;
  for (const double x : {-half_edge_mm, half_edge_mm})
    for (const double y : {-half_edge_mm, half_edge_mm})
      for (const double z : {-half_edge_mm, half_edge_mm}) corners.emplace_back(x, y, z);
  return corners;
}

}  // namespace usct::test
