#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

namespace usct {

/// Throws InputError, naming `source`, unless its number of points is that of `other`.
void require_same_count(const std::string& source, std::size_t count, const std::string& other,
                        std::size_t other_count);

struct LandmarkAlignment {
  /// `p_target = T_target_source * p_source`.
  Eigen::Isometry3d T_target_source;
  /// Root mean square distance between the pairs after the alignment.
  double residual_mm;
};

/// The rigid transform that aligns pairs of points in the least-squares sense, in closed form (Horn
/// 1987; here by singular value decomposition, Umeyama 1991, without scale). The result is always a
/// rotation: reflections are not undone.
///
/// Throws InputError if the numbers of points differ or are below 3, a point is not finite, or
/// either set is so close to a line (its spread across the line is below 5 % of the spread along
/// it) that the rotation about the line is undetermined. The names are those of the sets in its
/// message, such as their files.
LandmarkAlignment align_landmarks(const std::vector<Eigen::Vector3d>& points_target_mm,
                                  const std::vector<Eigen::Vector3d>& points_source_mm,
                                  const std::string& target_name = "target landmarks",
                                  const std::string& source_name = "source landmarks");

}  // namespace usct
