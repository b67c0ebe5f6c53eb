#include "us_ct_registration/registration/landmarks.h"

#include <cmath>

#include "geometry/point_spread.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

constexpr double kLeastTriangleRatio = 0.05;

Eigen::Matrix3Xd as_columns(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Matrix3Xd columns(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i)
    columns.col(static_cast<Eigen::Index>(i)) = points[i];
  return columns;
}

}  // namespace

void require_same_count(const std::string& source, std::size_t count, const std::string& other,
                        std::size_t other_count) {
  if (count == other_count) return;
  throw InputError(source, "has " + std::to_string(count) + " points, must have as many as " +
                               other + ", " + std::to_string(other_count));
}

LandmarkAlignment align_landmarks(const std::vector<Eigen::Vector3d>& points_target_mm,
                                  const std::vector<Eigen::Vector3d>& points_source_mm,
                                  const std::string& target_name, const std::string& source_name) {
  require_same_count(target_name, points_target_mm.size(), source_name, points_source_mm.size());
  require_spread(points_target_mm, kLeastTriangleRatio, target_name);
  require_spread(points_source_mm, kLeastTriangleRatio, source_name);

  const Eigen::Matrix3Xd target = as_columns(points_target_mm);
  const Eigen::Matrix3Xd source = as_columns(points_source_mm);
  LandmarkAlignment alignment;
  alignment.T_target_source.matrix() = Eigen::umeyama(source, target, false);
  const Eigen::Matrix3Xd residuals = target - alignment.T_target_source * source;
  alignment.residual_mm = std::sqrt(residuals.colwise().squaredNorm().mean());
  return alignment;
}

}  // namespace usct
