#include "us_ct_registration/registration/pose_parameters.h"

#include <Eigen/Eigenvalues>

#include "registration/spread.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct {
namespace {

/// The points only set scales here, so any that are not on a line in double precision will do.
constexpr double kLeastSpreadRatio = 1e-6;

Eigen::Matrix3d rotation_of(const Eigen::Vector3d& rotation_vector_rad) {
  const double angle = rotation_vector_rad.norm();
  if (angle == 0.0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, rotation_vector_rad / angle).toRotationMatrix();
}

Eigen::Vector3d rotation_vector_of(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

}  // namespace

PoseParameters::PoseParameters(const Eigen::Isometry3d& T_us_ct_initial,
                               const std::vector<Eigen::Vector3d>& points_us_mm)
    : T_us_ct_initial_(T_us_ct_initial) {
  require_rotation(T_us_ct_initial.linear(), "initial pose", "rotation");
  if (!T_us_ct_initial.translation().allFinite())
    throw InputError("initial pose", "'translation' is not finite");
  const registration::Spread spread =
      registration::spread_of(points_us_mm, kLeastSpreadRatio, "points of the field of view");
  centre_us_mm_ = spread.centroid_mm;
  // The mean of [p]x^T [p]x = |p|^2 I - p p^T.
  const Eigen::Matrix3d& covariance = spread.covariance_mm2;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> moments(
      covariance.trace() * Eigen::Matrix3d::Identity() - covariance);
  rotation_scale_ = moments.operatorInverseSqrt();
  inverse_rotation_scale_ = moments.operatorSqrt();
}

Eigen::Isometry3d PoseParameters::T_us_ct(const PoseVector& parameters) const {
  const Eigen::Matrix3d rotation = rotation_of(rotation_scale_ * parameters.head<3>());
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  T_us_ct.linear() = rotation * T_us_ct_initial_.linear();
  T_us_ct.translation() = centre_us_mm_ + parameters.tail<3>() +
                          rotation * (T_us_ct_initial_.translation() - centre_us_mm_);
  return T_us_ct;
}

PoseVector PoseParameters::parameters_of(const Eigen::Isometry3d& T_us_ct) const {
  const Eigen::Matrix3d rotation = T_us_ct.linear() * T_us_ct_initial_.linear().transpose();
  const Eigen::Vector3d translation_mm =
      T_us_ct.translation() - centre_us_mm_ -
      rotation * (T_us_ct_initial_.translation() - centre_us_mm_);
  return parameters_of_motion(rotation_vector_of(rotation), translation_mm);
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
  double sum_mm = 0.0;
  for (const Eigen::Vector3d& point : points_mm) sum_mm += (T_a * point - T_b * point).norm();
  return sum_mm / static_cast<double>(points_mm.size());
}

}  // namespace usct
