#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

namespace usct {

/// A way to pair fiducials of the two images.
struct FiducialMatch {
  /// Indices of the paired fiducials (ultrasound, CT), in the order of the ultrasound's.
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  /// Root mean square residual of the pairs after Horn's alignment, mm.
  double fre_mm = 0.0;
};

struct FiducialMatching {
  /// The pairings whose fiducial registration error is small enough for the localization error that
  /// was allowed, best first; at least one.
  std::vector<FiducialMatch> fitting;

  /// Whether a second pairing fits as well: the fiducials' arrangement is too symmetric for the
  /// localization error.
  bool ambiguous() const { return fitting.size() > 1; }
};

/// Pairs fiducials whose order is not known by their mutual distances, which a rigid alignment does
/// not change. If one image has more points than the other, as a detection in ultrasound may, each
/// point of the smaller set gets a partner and the others get none.
///
/// `fle_mm` is the root mean square localization error of a fiducial in space, both images
/// together. Two pairs are compatible if their distances differ by less than 4 standard deviations,
/// and a pairing fits if its error is below what that localization error exceeds in one of 1000
/// cases.
///
/// Throws InputError if the smaller set has fewer than 3 points or more than 8, the larger more
/// than 40, a point is not finite or the smaller set lies on a line, `fle_mm` is not above 0, or no
/// pairing fits. Its message begins with `source`.
FiducialMatching match_fiducials(const std::vector<Eigen::Vector3d>& fiducials_us_mm,
                                 const std::vector<Eigen::Vector3d>& fiducials_ct_mm, double fle_mm,
                                 const std::string& source = "fiducials to match");

/// The points of the pairs: ultrasound, CT.
std::pair<std::vector<Eigen::Vector3d>, std::vector<Eigen::Vector3d>> matched_points(
    const FiducialMatch& match, const std::vector<Eigen::Vector3d>& fiducials_us_mm,
    const std::vector<Eigen::Vector3d>& fiducials_ct_mm);

}  // namespace usct
