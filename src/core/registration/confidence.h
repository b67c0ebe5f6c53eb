#pragma once

#include <vector>

#include "registration/level.h"
#include "registration/search.h"

/// Whether a pose is to be believed, and how exact it is.
namespace usct::registration {

/// Values of a similarity at poses where nothing fits: median, and the deviation of a normal
/// distribution with the same upper decile (some poses fit a little, so that tails are long).
struct Background {
  double mean = 0.0;
  double deviation = 0.0;

  /// Deviations above the mean.
  double significance(double value) const {
    return deviation > 0.0 ? (value - mean) / deviation : 0.0;
  }
};

/// The same poses for all similarities: spread like the starts around the initial pose, but not
/// near `best`.
class BackgroundPoses {
 public:
  BackgroundPoses(const Eigen::Isometry3d& T_us_ct_initial, const RegistrationOptions& options,
                  const Search& search);

  Background of(const Similarity& similarity, const Candidate& best, Search& search) const;

 private:
  std::vector<Candidate> poses_;
};

/// How well defined a pose is: by what a similarity does around it.
struct PoseAccuracy {
  /// How far the similarity's parts pull the pose apart, mm (root mean square displacement of the
  /// points): with H its Hessian and g_p the gradients of its parts, by `H^-1 (sum_p g_p g_p^T)
  /// H^-1` (the sandwich estimator, Huber 1967).
  double scatter_mm = 0.0;
  /// Of a small motion (rotation vector in rad and translation in mm, in the US frame, about its
  /// origin: p -> p + w x p + t) that follows the pose: the same, widened as ConfidenceOptions say.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// Unset for a similarity of fewer than seven parts, and where it is constant.
std::optional<PoseAccuracy> pose_accuracy(const Similarity& similarity, const Candidate& best,
                                          const ConfidenceOptions& options, const Search& search);

/// Root mean square over the points of the expected displacement, mm.
double expected_error_mm(const Eigen::Matrix<double, 6, 6>& covariance,
                         const std::vector<Eigen::Vector3d>& points_us_mm);

/// Whether all measures that there are pass the gates.
bool passes(const ConfidenceOptions& options, const std::map<std::string, double>& measures);

/// Status and message by the gates, from the overlap and the measures; a measure that is absent is
/// not judged.
void judge(const ConfidenceOptions& options, RegistrationResult& result);

}  // namespace usct::registration
