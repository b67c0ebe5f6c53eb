#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

/// Target registration error (TRE): the distance between the true position of a target and the
/// position at which the registration places it. It differs from the residual of landmarks, which
/// says little about targets.
namespace usct {

/// Statistics of the errors of all targets, in mm.
struct TargetErrors {
  double mean_mm = 0.0;
  double rms_mm = 0.0;
  double median_mm = 0.0;
  double max_mm = 0.0;
  /// Errors in the order of the targets.
  std::vector<double> per_target_mm;
};

/// The CT point of a target p (US frame, mm) is `T_us_ct_true^-1 p`; the registration puts it at
/// `T_us_ct T_us_ct_true^-1 p`, and the error is its distance from p. It does not depend on the
/// frame of the CT. Throws InputError if there is no target, one is not finite, or a pose is not.
TargetErrors evaluate_targets(const Eigen::Isometry3d& T_us_ct,
                              const Eigen::Isometry3d& T_us_ct_true,
                              const std::vector<Eigen::Vector3d>& points_us_mm);

/// The TRE that a covariance predicts, as root mean squares in mm.
struct ExpectedTargetErrors {
  /// Root mean square over all targets.
  double rms_mm = 0.0;
  /// Root mean square error of the target for which it is largest.
  double max_mm = 0.0;
};

/// `covariance` is that of a result (see registration_result.h): the covariance of the small motion
/// `p -> p + w x p + t` in the US frame, (w rad, t mm). A target p moves by J (w, t) with `J =
/// [-[p]x | I]`, so that the expected square of its error is trace(J C J^T). Throws InputError if
/// there is no target, a target is not finite, or the covariance is not finite, symmetric and
/// positive semidefinite (to 1e-6 of its diagonal); the message names `source`.
ExpectedTargetErrors expected_tre_mm(const Eigen::Matrix<double, 6, 6>& covariance,
                                     const std::vector<Eigen::Vector3d>& points_us_mm,
                                     const std::string& source = "result");

}  // namespace usct
