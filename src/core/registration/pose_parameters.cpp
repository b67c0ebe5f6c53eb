#include "us_ct_registration/registration/pose_parameters.h"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "geometry/point_spread.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct {
namespace {

/// The left Jacobian J of SO(3): exp(w + d) = exp(J d) exp(w) for small d.
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const Eigen::Matrix3d cross = cross_matrix(w);
  constexpr double kSmall = 1e-4;  // the next terms of the series are below rounding
  const double first =
      angle < kSmall ? 0.5 - angle * angle / 24.0 : (1.0 - std::cos(angle)) / (angle * angle);
  const double second = angle < kSmall ? 1.0 / 6.0 - angle * angle / 120.0
                                       : (angle - std::sin(angle)) / std::pow(angle, 3);
  return Eigen::Matrix3d::Identity() + first * cross + second * cross * cross;
}

void require_initial(const Eigen::Isometry3d& T_us_ct_initial) {
  require_rotation(T_us_ct_initial.linear(), "initial pose", "rotation");
  if (!T_us_ct_initial.translation().allFinite())
    throw InputError("initial pose", "'translation' is not finite");
}

}  // namespace

PoseParameters::PoseParameters(const Eigen::Isometry3d& T_us_ct_initial,
                               const std::vector<Eigen::Vector3d>& points_us_mm)
    : T_us_ct_initial_(T_us_ct_initial) {
  require_initial(T_us_ct_initial);
  // The points only set scales here, so any that are not on a line will do.
  require_spread(points_us_mm, kLeastSpreadRatio, "points of the field of view");
  const PointSpread spread = point_spread(points_us_mm);
  centre_us_mm_ = spread.centroid_mm;
  // The mean of [p]x^T [p]x = |p|^2 I - p p^T.
  const Eigen::Matrix3d& covariance = spread.covariance_mm2;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> moments(
      covariance.trace() * Eigen::Matrix3d::Identity() - covariance);
  rotation_scale_ = moments.operatorInverseSqrt();
  inverse_rotation_scale_ = moments.operatorSqrt();
}

PoseParameters PoseParameters::about(const Eigen::Isometry3d& T_us_ct_initial) const {
  require_initial(T_us_ct_initial);
  PoseParameters result = *this;
  result.T_us_ct_initial_ = T_us_ct_initial;
  return result;
}

Eigen::Isometry3d PoseParameters::T_us_ct(const PoseVector& parameters) const {
  const Eigen::Matrix3d rotation = rotation_from_vector(rotation_scale_ * parameters.head<3>());
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  T_us_ct.linear() = rotation * T_us_ct_initial_.linear();
  T_us_ct.translation() = centre_us_mm_ + parameters.tail<3>() +
                          rotation * (T_us_ct_initial_.translation() - centre_us_mm_);
  return T_us_ct;
}

Eigen::Matrix<double, 6, 6> PoseParameters::motion_derivative(const PoseVector& parameters) const {
  Eigen::Matrix<double, 6, 6> derivative = Eigen::Matrix<double, 6, 6>::Identity();
  derivative.topLeftCorner<3, 3>() =
      left_jacobian(rotation_scale_ * parameters.head<3>()) * rotation_scale_;
  // A rotation about the moved centre c is one about the origin and a translation by -w x c.
  derivative.bottomLeftCorner<3, 3>() =
      cross_matrix(centre_us_mm_ + parameters.tail<3>()) * derivative.topLeftCorner<3, 3>();
  return derivative;
}

PoseVector PoseParameters::parameters_of_motion(const Eigen::Vector3d& rotation_vector_rad,
                                                const Eigen::Vector3d& translation_mm) const {
  PoseVector parameters;
  parameters << inverse_rotation_scale_ * rotation_vector_rad, translation_mm;
  return parameters;
}

double mean_displacement_mm(const Eigen::Isometry3d& T_a, const Eigen::Isometry3d& T_b,
                            const std::vector<Eigen::Vector3d>& points_mm) {
  if (points_mm.empty()) throw InputError("mean displacement", "0 points, must be at least 1");
  const Eigen::Matrix3d linear = T_a.linear() - T_b.linear();
  const Eigen::Vector3d translation = T_a.translation() - T_b.translation();
  double sum_mm = 0.0;
  for (const Eigen::Vector3d& point : points_mm) sum_mm += (linear * point + translation).norm();
  return sum_mm / static_cast<double>(points_mm.size());
}

}  // namespace usct
