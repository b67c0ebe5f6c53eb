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

/// The physical error of matched points (mm): target i is at `points_ct_mm[i]` in the CT and was at
/// `points_us_mm[i]` in the US frame during the ultrasound, deformation included. The registration
/// puts it at `T_us_ct points_ct_mm[i]`, and the error is its distance from `points_us_mm[i]`.
/// Throws InputError if there is no target, the numbers of points differ, a point is not finite, or
/// the pose is not.
TargetErrors evaluate_matched_targets(const Eigen::Isometry3d& T_us_ct,
                                      const std::vector<Eigen::Vector3d>& points_ct_mm,
                                      const std::vector<Eigen::Vector3d>& points_us_mm);

/// The points of the CT that a rigid pose puts at `points_us_mm`: `T_us_ct^-1 p`, mm.
std::vector<Eigen::Vector3d> ct_points_mm(const Eigen::Isometry3d& T_us_ct,
                                          const std::vector<Eigen::Vector3d>& points_us_mm);

/// The error against a rigid truth, which is the physical error if nothing deformed: the CT point
/// of a target p (US frame, mm) is `T_us_ct_true^-1 p`. It does not depend on the frame of the CT.
/// Throws InputError if there is no target, one is not finite, or a pose is not.
TargetErrors evaluate_targets(const Eigen::Isometry3d& T_us_ct,
                              const Eigen::Isometry3d& T_us_ct_true,
                              const std::vector<Eigen::Vector3d>& points_us_mm);

/// Throws InputError, naming `source`, unless the covariance of a motion (rad, mm) is finite,
/// symmetric and positive semidefinite, to 1e-6 of its diagonal.
void require_covariance(const Eigen::Matrix<double, 6, 6>& covariance, const std::string& source);

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
/// there is no target or one is not finite, and as `require_covariance`; the message names
/// `source`.
ExpectedTargetErrors expected_tre_mm(const Eigen::Matrix<double, 6, 6>& covariance,
                                     const std::vector<Eigen::Vector3d>& points_us_mm,
                                     const std::string& source = "result");

}  // namespace usct
