#include "geometry/point_spread.h"

#include <Eigen/Eigenvalues>
#include <sstream>

#include "us_ct_registration/error.h"

namespace usct {
namespace {

bool is_line(const PointSpread& spread, double least_ratio) {
  return !(spread.deviations_mm[1] > least_ratio * spread.deviations_mm[2]);
}

}  // namespace

PointSpread point_spread(const std::vector<Eigen::Vector3d>& points_mm) {
  const auto count = static_cast<double>(points_mm.size());
  PointSpread spread{Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero(), Eigen::Vector3d::Zero()};
  for (const Eigen::Vector3d& point : points_mm) spread.centroid_mm += point / count;
  for (const Eigen::Vector3d& point : points_mm) {
    const Eigen::Vector3d offset = point - spread.centroid_mm;
    spread.covariance_mm2 += offset * offset.transpose() / count;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread.covariance_mm2,
                                                            Eigen::EigenvaluesOnly);
  spread.deviations_mm = axes.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return spread;
}

void require_spread(const std::vector<Eigen::Vector3d>& points_mm, double least_ratio,
                    const std::string& source) {
  if (points_mm.size() < 3)
    throw InputError(source, std::to_string(points_mm.size()) + " points, must be at least 3");
  for (std::size_t i = 0; i < points_mm.size(); ++i)
    if (!points_mm[i].allFinite())
      throw InputError(source, "point " + std::to_string(i) + " is not finite");
  const PointSpread spread = point_spread(points_mm);
  if (!is_line(spread, least_ratio)) return;
  std::ostringstream violation;
  violation << "points lie on a line: they spread by " << spread.deviations_mm[2]
            << " mm along it and " << spread.deviations_mm[1] << " mm across, must be more than "
            << 100.0 * least_ratio << " % across";
  throw InputError(source, violation.str());
}

bool lie_on_a_line(const std::vector<Eigen::Vector3d>& points_mm) {
  return is_line(point_spread(points_mm), kLeastSpreadRatio);
}

}  // namespace usct
