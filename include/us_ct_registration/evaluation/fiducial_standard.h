#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

/// The gold standard of alignment from fiducials that both images show (thesis 3.1.4), and how
/// exact it is, by the theory of Fitzpatrick, West and Maurer (IEEE TMI 17, 1998).
namespace usct {

/// One fiducial under the standard.
struct FiducialResidual {
  /// Distance between the fiducial in the ultrasound and that of the CT after the alignment, mm.
  double residual_mm = 0.0;
  /// The same distance if the other fiducials alone determine the alignment; unset if they cannot,
  /// since they are fewer than three or lie on a line. A fiducial that was localized wrongly, or
  /// was matched with another, shows here more clearly than in its residual.
  std::optional<double> left_out_mm;
};

struct FiducialStandard {
  Eigen::Isometry3d T_us_ct;
  /// Fiducial registration error (FRE): root mean square of the residuals, mm.
  double fre_mm = 0.0;
  /// Fiducial localization error (FLE) that the FRE stands for, both images together, as the root
  /// mean square length in space: FLE^2 = FRE^2 / (1 - 2/N). An estimate from 3 N - 6 degrees of
  /// freedom, which for few fiducials is rough.
  double fle_mm = 0.0;
  std::vector<FiducialResidual> fiducials;

  /// Target registration error (TRE) that the FLE predicts at a point of the US frame, mm, root
  /// mean square over repeated localizations:
  /// TRE^2 = FLE^2 / N (1 + 1/3 sum_k d_k^2 / f_k^2), with the distances d of the point, and f
  /// (root mean square) of the fiducials, from the fiducials' principal axis k.
  double predicted_tre_mm(const Eigen::Vector3d& point_us_mm) const;

  /// Centroid and principal axes (columns) of the fiducials in the US frame, and the root mean
  /// square distances of the fiducials from these axes, mm.
  Eigen::Vector3d centroid_us_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes_us = Eigen::Matrix3d::Identity();
  Eigen::Vector3d distances_mm = Eigen::Vector3d::Zero();
};

/// Aligns matched fiducials by Horn's method (registration/landmarks.h, where the errors and the
/// names are).
FiducialStandard fiducial_standard(const std::vector<Eigen::Vector3d>& fiducials_us_mm,
                                   const std::vector<Eigen::Vector3d>& fiducials_ct_mm,
                                   const std::string& us_name = "fiducials of the ultrasound",
                                   const std::string& ct_name = "fiducials of the CT");

}  // namespace usct
