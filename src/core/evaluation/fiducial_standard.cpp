#include "us_ct_registration/evaluation/fiducial_standard.h"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "geometry/point_spread.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/registration/landmarks.h"

namespace usct {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

Points without(Points points, std::size_t i) {
  points.erase(points.begin() + static_cast<std::ptrdiff_t>(i));
  return points;
}

std::optional<double> left_out_mm(const Points& us_mm, const Points& ct_mm, std::size_t i) {
  if (us_mm.size() < 4) return std::nullopt;
  try {
    const LandmarkAlignment others = align_landmarks(without(us_mm, i), without(ct_mm, i));
    return (us_mm[i] - others.T_target_source * ct_mm[i]).norm();
  } catch (const InputError&) {
    return std::nullopt;  // the others lie on a line
  }
}

}  // namespace

FiducialStandard fiducial_standard(const Points& fiducials_us_mm, const Points& fiducials_ct_mm,
                                   const std::string& us_name, const std::string& ct_name) {
  const LandmarkAlignment alignment =
      align_landmarks(fiducials_us_mm, fiducials_ct_mm, us_name, ct_name);
  const auto count = static_cast<double>(fiducials_us_mm.size());
  FiducialStandard standard;
  standard.T_us_ct = alignment.T_target_source;
  standard.fre_mm = alignment.residual_mm;
  standard.fle_mm = standard.fre_mm / std::sqrt(1.0 - 2.0 / count);
  for (std::size_t i = 0; i < fiducials_us_mm.size(); ++i)
    standard.fiducials.push_back(
        {(fiducials_us_mm[i] - standard.T_us_ct * fiducials_ct_mm[i]).norm(),
         left_out_mm(fiducials_us_mm, fiducials_ct_mm, i)});
  const PointSpread spread = point_spread(fiducials_us_mm);
  standard.centroid_us_mm = spread.centroid_mm;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(spread.covariance_mm2);
  standard.axes_us = solver.eigenvectors();
  // The mean square distance from an axis is the sum of the variances along the other two.
  const Vector3d variances = solver.eigenvalues().cwiseMax(0.0);
  standard.distances_mm = (Vector3d::Constant(variances.sum()) - variances).cwiseSqrt();
  return standard;
}

double FiducialStandard::predicted_tre_mm(const Vector3d& point_us_mm) const {
  const Vector3d along = axes_us.transpose() * (point_us_mm - centroid_us_mm);
  double ratios = 0.0;
  for (int axis = 0; axis < 3; ++axis)
    ratios += (along.squaredNorm() - along[axis] * along[axis]) /
              (distances_mm[axis] * distances_mm[axis]);
  return fle_mm * std::sqrt((1.0 + ratios / 3.0) / static_cast<double>(fiducials.size()));
}

}  // namespace usct
