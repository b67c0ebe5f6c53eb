#include "io/rigid.h"

#include "io/text.h"
#include "us_ct_registration/error.h"

namespace usct::io {

void require_rotation(const Eigen::Matrix3d& matrix, const std::string& source,
                      const std::string& field) {
  constexpr double kTolerance = 1e-5;
  const double deviation =
      (matrix.transpose() * matrix - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  const double determinant = matrix.determinant();
  // Written so that NaN fails.
  if (deviation <= kTolerance && determinant > 0.0) return;
  throw InputError(source, "'" + field + "' is not a rotation: determinant " +
                               format_double(determinant) + ", deviation from orthonormal " +
                               format_double(deviation) +
                               ", must be 1 and <= " + format_double(kTolerance));
}

}  // namespace usct::io
