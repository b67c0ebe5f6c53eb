#include "geometry/centroid.h"

#include "us_ct_registration/error.h"

namespace usct {

Eigen::Vector3d centroid(const std::vector<Eigen::Vector3d>& points_mm) {
  if (points_mm.empty()) throw InputError("targets", "there are 0, must be at least 1");
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points_mm) sum += p;
  if (!sum.allFinite()) throw InputError("targets", "must be finite");
  return sum / static_cast<double>(points_mm.size());
}

}  // namespace usct
