#pragma once

#include <Eigen/Geometry>
#include <string>

namespace usct::io {

/// Throws InputError, naming `field`, determinant and deviation, unless the matrix is a rotation:
/// finite, right-handed, and each entry of MᵀM within 1e-5 of the identity (what rounding in text
/// files may cost; it moves a point of the kidney by micrometres).
void require_rotation(const Eigen::Matrix3d& matrix, const std::string& source,
                      const std::string& field);

}  // namespace usct::io
