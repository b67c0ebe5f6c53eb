#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

namespace usct::test {

/// Points spread over an ellipsoid, by the golden angle; those with x + y / 2 + 0.3 z > `cut` of
/// the half axes are left out, which takes away its symmetry.
inline std::vector<Eigen::Vector3d> ellipsoid(const Eigen::Vector3d& radii_mm, int count,
                                              double cut = 2.0) {
  const double golden = EIGEN_PI * (3.0 - std::sqrt(5.0));
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / count;
    const double ring = std::sqrt(1.0 - z * z);
    const Eigen::Vector3d unit(ring * std::cos(golden * i), ring * std::sin(golden * i), z);
    if (unit.x() + 0.5 * unit.y() + 0.3 * unit.z() < cut)
      points.push_back(unit.cwiseProduct(radii_mm));
  }
  return points;
}

/// An ellipsoid of the size of a kidney with a bump as of a tumour, which leaves it no symmetry.
inline std::vector<Eigen::Vector3d> bumpy_ellipsoid(int count) {
  const Eigen::Vector3d radii_mm(55.0, 30.0, 22.0);
  const Eigen::Vector3d top = Eigen::Vector3d(0.6, 0.7, 0.4).normalized();
  std::vector<Eigen::Vector3d> points = ellipsoid(radii_mm, count);
  for (Eigen::Vector3d& p : points) {
    const double square = (p.cwiseQuotient(radii_mm) - top).squaredNorm();
    p *= 1.0 + 0.3 * std::exp(-square / 0.15);
  }
  return points;
}

/// Root mean square distance between the points as two poses place them.
inline double rms_displacement_mm(const Eigen::Isometry3d& A, const Eigen::Isometry3d& B,
                                  const std::vector<Eigen::Vector3d>& points) {
  double squares = 0.0;
  for (const Eigen::Vector3d& p : points) squares += (A * p - B * p).squaredNorm();
  return std::sqrt(squares / static_cast<double>(points.size()));
}

}  // namespace usct::test
