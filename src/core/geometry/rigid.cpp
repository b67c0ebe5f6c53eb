#include "us_ct_registration/geometry/rigid.h"

#include <cmath>
#include <limits>

#include "text.h"
#include "us_ct_registration/error.h"

namespace usct {

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return matrix;
}

Eigen::Matrix3d rotation_from_vector(const Eigen::Vector3d& rotation_vector_rad) {
  const double angle = rotation_vector_rad.norm();
  if (angle == 0.0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, rotation_vector_rad / angle).toRotationMatrix();
}

Eigen::Vector3d rotation_vector_of(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

double deviation_from_rotation(const Eigen::Matrix3d& matrix) {
  if (!matrix.allFinite() || !(matrix.determinant() > 0.0))
    return std::numeric_limits<double>::infinity();
  return (matrix.transpose() * matrix - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
}

void require_rotation(const Eigen::Matrix3d& matrix, const std::string& source,
                      const std::string& field, double tolerance) {
  const double deviation = deviation_from_rotation(matrix);
  if (deviation <= tolerance) return;
  throw InputError(source, "'" + field + "' is not a rotation: determinant " +
                               format_double(matrix.determinant()) +
                               ", deviation from orthonormal " + format_double(deviation) +
                               ", must be 1 and <= " + format_double(tolerance));
}

void require_rigid(const Eigen::Isometry3d& T, const std::string& source, double tolerance) {
  if (T.translation().allFinite() && deviation_from_rotation(T.linear()) <= tolerance) return;
  throw InputError(source, "is not a finite rotation and translation");
}

Eigen::Isometry3d rigid_from_quaternion(const Eigen::Quaterniond& rotation,
                                        const Eigen::Vector3d& translation,
                                        const std::string& source) {
  constexpr double kLengthTolerance = 1e-3;
  if (!translation.allFinite()) throw InputError(source, "the translation is not finite");
  if (!(std::abs(rotation.norm() - 1.0) <= kLengthTolerance))
    throw InputError(
        source, "the quaternion has length " + std::to_string(rotation.norm()) + ", must be 1");
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = rotation.normalized().toRotationMatrix();
  T.translation() = translation;
  return T;
}

}  // namespace usct
