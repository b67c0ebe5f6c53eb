#include "phantom/scenes.h"

#include <algorithm>
#include <cmath>

namespace usct::phantom {

using Eigen::Vector3d;

std::vector<Vector3d> even_directions(int count) {
  std::vector<Vector3d> directions;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / count;
    const double angle = i * 2.399963229728653;  // the golden angle
    const double r = std::sqrt(1.0 - z * z);
    directions.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
  }
  return directions;
}

Eigen::Matrix3d looking(const Vector3d& forward, const Vector3d& lateral) {
  Eigen::Matrix3d R;
  R.col(1) = forward.normalized();
  R.col(0) = (lateral - lateral.dot(R.col(1)) * R.col(1)).normalized();
  R.col(2) = R.col(0).cross(R.col(1));
  return R;
}

double depth_that_shows_kidney_mm(const Scene& scene) {
  double deepest = 0.0;
  for (const Vector3d& p : scene.kidney_surface_ct_mm)
    deepest = std::max(deepest, (scene.T_ct_probe.inverse() * p).y());
  return 5.0 * std::ceil((deepest + 28.0) / 5.0);
}

}  // namespace usct::phantom
