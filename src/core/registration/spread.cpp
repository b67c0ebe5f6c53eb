#include "registration/spread.h"

#include <Eigen/Eigenvalues>
#include <sstream>

#include "us_ct_registration/error.h"

namespace usct::registration {

namespace {

Spread about_centroid(const std::vector<Eigen::Vector3d>& points_mm) {
  const auto count = static_cast<double>(points_mm.size());
  Spread spread{Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero(), Eigen::Vector3d::Zero()};
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

bool is_line(const Spread& spread, double least_ratio) {
  return !(spread.deviations_mm[1] > least_ratio * spread.deviations_mm[2]);
}

}  // namespace

Spread spread_of(const std::vector<Eigen::Vector3d>& points_mm, double least_ratio,
                 const std::string& source) {
  if (points_mm.size() < 3)
    throw InputError(source, std::to_string(points_mm.size()) + " points, must be at least 3");
  for (std::size_t i = 0; i < points_mm.size(); ++i)
    if (!points_mm[i].allFinite())
      throw InputError(source, "point " + std::to_string(i) + " is not finite");
  const Spread spread = about_centroid(points_mm);
  if (is_line(spread, least_ratio)) {
    std::ostringstream violation;
    violation << "points lie on a line: they spread by " << spread.deviations_mm[2]
              << " mm along it and " << spread.deviations_mm[1] << " mm across, must be more than "
              << 100.0 * least_ratio << " % across";
    throw InputError(source, violation.str());
  }
  return spread;
}

bool lie_on_a_line(const std::vector<Eigen::Vector3d>& points_mm) {
  return is_line(about_centroid(points_mm), kLeastSpreadRatio);
}

}  // namespace usct::registration
