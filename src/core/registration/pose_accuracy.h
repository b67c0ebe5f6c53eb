#pragma once

#include <optional>
#include <vector>

#include "registration/background.h"
#include "registration/image_pyramid.h"

/// Measures of a pose: whether it is better than chance, whether it has a rival, and how exact it
/// is.
namespace usct::registration {

/// Accuracy of a pose, estimated from the similarity around it.
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
                                          const ConfidenceOptions& options,
                                          const FieldPoints& field, const Run& run);

struct Assessment {
  Measures measures;
  std::optional<Eigen::Matrix<double, 6, 6>> covariance;
};

/// Measures what the search found and the refinement made of it.
class Assessor {
 public:
  /// What is referred to must outlive it.
  Assessor(const ImagePyramid& images, const Eigen::Isometry3d& T_us_ct_initial,
           const RegistrationOptions& options);

  /// `optima`: of the search, best first; `refined`: what the refinement made of the first one.
  Assessment assess(const std::vector<Candidate>& optima, const Candidate& refined, Run& run) const;

  /// Drops leading optima that are farther from the initial pose than the gate allows and that are
  /// pulled apart as well: they would be refused, and must not stand in the way of the next best.
  /// One optimum always stays.
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
