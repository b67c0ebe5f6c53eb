#pragma once

#include <Eigen/Geometry>
#include <vector>

/// Registration of points by an unscented Kalman filter (Moghari and Abolmaesumi, IEEE TMI 26,
/// 2007; thesis 2.3), for comparison: the pose is a state of six parameters whose uncertainty
/// shrinks with each point that the filter takes.
namespace usct {

struct UnscentedFilterOptions {
  /// Standard deviations of the start along and about each axis; > 0.
  double shift_deviation_mm = 10.0;
  double turn_deviation_rad = 0.2;
  /// Standard deviation of a point along each axis, of both images together, mm; > 0.
  double point_deviation_mm = 1.0;
  /// Times that all points are taken; >= 1. Each pass starts from the pose of the last one with the
  /// start's uncertainty, since a point counts once only.
  int passes = 100;

  /// Throws InputError naming the option, its value and the constraint.
  void validate() const;
};

struct UnscentedFilterResult {
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  /// Covariance of a motion after the last point: shift along x, y, z of the US frame (mm), turn
  /// about these axes through `centre_us_mm` (rad).
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Vector3d centre_us_mm = Eigen::Vector3d::Zero();
  /// The state's uncertainty after each point of the last pass: root of the trace of the shift's
  /// covariance, mm.
  std::vector<double> shift_deviations_mm;
  /// Root mean square distance of the pairs at the end, mm.
  double distance_mm = 0.0;
};

/// Aligns matched points, in the same order. Throws InputError if the options are out of range, the
/// numbers of points differ or are below 3, or a set lies on a line.
UnscentedFilterResult filter_pairs(const std::vector<Eigen::Vector3d>& points_us_mm,
                                   const std::vector<Eigen::Vector3d>& points_ct_mm,
                                   const Eigen::Isometry3d& start_T_us_ct,
                                   const UnscentedFilterOptions& options = {});

/// Aligns points of surfaces: each point of the ultrasound is compared with the point of the CT
/// that is nearest in the state of that moment. Throws InputError if the options are out of range,
/// or a set has fewer than 3 points or lies on a line.
UnscentedFilterResult filter_surfaces(const std::vector<Eigen::Vector3d>& surface_us_mm,
                                      const std::vector<Eigen::Vector3d>& surface_ct_mm,
                                      const Eigen::Isometry3d& start_T_us_ct,
                                      const UnscentedFilterOptions& options = {});

}  // namespace usct
