#pragma once

#include <Eigen/Geometry>
#include <string>

/// Rotations and rigid transforms, and tests for them; the whole project uses these.
namespace usct {

/// The matrix of the cross product: [v]x p = v x p.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v);

/// The rotation about a vector by its length, rad; the identity for the zero vector.
Eigen::Matrix3d rotation_from_vector(const Eigen::Vector3d& rotation_vector_rad);

/// The vector of a rotation, of a length in [0, pi] rad.
Eigen::Vector3d rotation_vector_of(const Eigen::Matrix3d& rotation);

/// Tolerance on each entry of MᵀM - 1. It allows for the rounding of text files with about six
/// digits, which moves a point of the kidney by micrometres.
constexpr double kRotationTolerance = 1e-5;

/// The largest entry of |MᵀM - 1|; infinite unless the matrix is finite and right-handed.
double deviation_from_rotation(const Eigen::Matrix3d& matrix);

/// Throws InputError, naming `source` and `field`, determinant and deviation, unless the matrix is
/// a rotation within the tolerance.
void require_rotation(const Eigen::Matrix3d& matrix, const std::string& source,
                      const std::string& field, double tolerance = kRotationTolerance);

/// Throws InputError, naming `source`, unless the translation is finite and the linear part a
/// rotation.
void require_rigid(const Eigen::Isometry3d& T, const std::string& source,
                   double tolerance = kRotationTolerance);

/// The rigid transform of a quaternion and a translation. Throws InputError, naming `source`,
/// unless the translation is finite and the quaternion has length 1 within 1e-3: a quaternion that
/// nobody set is all zero, which is no rotation.
Eigen::Isometry3d rigid_from_quaternion(const Eigen::Quaterniond& rotation,
                                        const Eigen::Vector3d& translation,
                                        const std::string& source);

}  // namespace usct
