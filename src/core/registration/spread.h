#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace usct::registration {

/// Centroid of points, and their spread about it.
struct Spread {
  Eigen::Vector3d centroid_mm;
  /// Mean of `(p - centroid) (p - centroid)^T`, mm^2.
  Eigen::Matrix3d covariance_mm2;
  /// Standard deviations along the principal axes, ascending.
  Eigen::Vector3d deviations_mm;
};

/// Throws InputError, naming `source`, if there are fewer than three points, one is not finite, or
/// the second largest deviation is below `least_ratio` of the largest, that is they lie on a line.
Spread spread_of(const std::vector<Eigen::Vector3d>& points_mm, double least_ratio,
                 const std::string& source);

}  // namespace usct::registration
