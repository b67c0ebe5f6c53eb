#include "us_ct_registration/geometry/rigid.h"

#include <limits>

#include "text.h"
#include "us_ct_registration/error.h"

namespace usct {

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

}  // namespace usct
