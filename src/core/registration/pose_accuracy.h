#pragma once

#include <optional>
#include <vector>

#include "registration/background.h"
#include "registration/image_pyramid.h"

/// Measures of a pose: its significance, its margin above rivals and its accuracy.
namespace usct::registration {

/// Accuracy of a pose, estimated from the similarity around it.
struct PoseAccuracy {
  /// Root mean square displacement of the points by which the similarity's parts disagree about the
  /// pose, mm. With H the Hessian of the similarity and g_p the gradients of its parts it follows
  /// from `H^-1 (sum_p g_p g_p^T) H^-1` (the sandwich estimator, Huber 1967).
  double scatter_mm = 0.0;
  /// Covariance of a small motion (rotation vector in rad and translation in mm, in the US frame,
  /// about its origin: p -> p + w x p + t) that follows the pose, widened as ConfidenceOptions say.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// Estimates the accuracy; unset for a similarity of fewer than seven parts or a constant one.
std::optional<PoseAccuracy> pose_accuracy(const Similarity& similarity, const Candidate& best,
                                          const ConfidenceOptions& options,
                                          const FieldPoints& field, const Run& run);

struct Assessment {
  Measures measures;
  std::optional<Eigen::Matrix<double, 6, 6>> covariance;
};

/// Measures the optima of the search and the refined pose.
class Assessor {
 public:
  /// The objects that the arguments refer to must outlive the assessor.
  Assessor(const ImagePyramid& images, const Eigen::Isometry3d& T_us_ct_initial,
           const RegistrationOptions& options);

  /// `optima` are those of the search, best first; `refined` is the first one after its refinement.
  Assessment assess(const std::vector<Candidate>& optima, const Candidate& refined, Run& run) const;

  /// Drops leading optima that are farther from the initial pose than the gate allows and whose
  /// scatter fails its gate as well: they would be refused, and must not hide the next best. One
  /// optimum always stays.
  void drop_distant(std::vector<Candidate>& optima, const Run& run) const;

 private:
  double margin(const std::vector<Candidate>& optima, const Background& background,
                const Run& run) const;
  bool holds_together(const Candidate& candidate, const Run& run) const;
  std::optional<PoseAccuracy> accuracy_of(const Candidate& candidate, const Run& run) const;

  const ImagePyramid& images_;
  const Eigen::Isometry3d& T_us_ct_initial_;
  const RegistrationOptions& options_;
  BackgroundPoses background_;
};

}  // namespace usct::registration
