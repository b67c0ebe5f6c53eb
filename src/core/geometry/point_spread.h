#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace usct {

/// Points that spread by less than this across a line, as a share of what they spread along it, lie
/// on it in double precision.
constexpr double kLeastSpreadRatio = 1e-6;

/// Centroid of points, and their spread about it.
struct PointSpread {
  Eigen::Vector3d centroid_mm;
  /// Mean of `(p - centroid) (p - centroid)^T`, mm^2.
  Eigen::Matrix3d covariance_mm2;
  /// Standard deviations along the principal axes, ascending.
  Eigen::Vector3d deviations_mm;
};

/// The spread of finite points, of which there must be one at least.
PointSpread point_spread(const std::vector<Eigen::Vector3d>& points_mm);

/// Throws InputError, naming `source`, if there are fewer than three points, one is not finite, or
/// the second largest deviation is not above `least_ratio` of the largest, that is they lie on a
/// line.
void require_spread(const std::vector<Eigen::Vector3d>& points_mm, double least_ratio,
                    const std::string& source);

/// Whether finite points lie on a line, within kLeastSpreadRatio.
bool lie_on_a_line(const std::vector<Eigen::Vector3d>& points_mm);

}  // namespace usct
