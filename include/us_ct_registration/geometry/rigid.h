#pragma once

#include <Eigen/Geometry>
#include <string>

/// Checks of rotations and rigid transforms; all of the project uses these.
namespace usct {

/// How far each entry of MᵀM may be from the identity. It allows for the rounding of text files
/// with about six digits, which moves a point of the kidney by micrometres.
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

}  // namespace usct
