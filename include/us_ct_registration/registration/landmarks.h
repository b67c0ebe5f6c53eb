#pragma once

#include <Eigen/Geometry>
#include <vector>

namespace usct {

struct LandmarkAlignment {
  /// `p_target = T_target_source * p_source`.
  Eigen::Isometry3d T_target_source;
  /// Root mean square of what is left between the pairs.
  double residual_mm;
};

/// The rigid transform that brings pairs of points together best in the least squares sense, in
/// closed form (Horn 1987; here by singular values, Umeyama 1991, without scale). Mirror images are
/// not undone: the result is always a rotation.
///
/// Throws InputError if the numbers of points differ or are below 3, a point is not finite, or
/// either set is so close to a line (across it less than 5 % of the spread along it) that rotation
/// about the line is a guess.
LandmarkAlignment align_landmarks(const std::vector<Eigen::Vector3d>& points_target_mm,
                                  const std::vector<Eigen::Vector3d>& points_source_mm);

}  // namespace usct
