#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "registration/evidence/deformation.h"
#include "registration/run.h"
#include "registration/search/candidates.h"
#include "us_ct_registration/similarity/similarity.h"

namespace usct::registration {

struct LocalAgreementOptions {
  /// The edge of the clusters' cubes, and the translations that they are offered, mm.
  double cluster_mm;
  double step_mm;
  /// The motion of tissue is that of clusters whose cubes' middles are in there.
  TissueRegion tissue;
};

/// How far clusters of the ultrasound agree with a pose that they share. Each cluster could reach a
/// higher similarity by a translation of its own, of -step_mm, 0 or step_mm along each axis of the
/// US frame. The rise in reach is that from the mean over these 27 translations to the best one of
/// each cluster, summed over the clusters.
struct LocalAgreement {
  /// The mean of two shares of the rise in reach: the one that the shared pose reaches, and the one
  /// that each cluster reaches with the translation that its neighbours together like best.
  ///
  /// A rigid motion makes a wrong pose an optimum of the whole; it has six parameters and cannot
  /// make it one for each of a hundred clusters, which the first share asks. Soft tissue that has
  /// moved since the CT lowers the first share as well; but it moves with its neighbours, which the
  /// second share asks. Among n clusters that have nothing to do with the pose chance makes up a
  /// share in proportion to 1 / sqrt(n), as the best of many sums of n random terms: this is taken
  /// off. The result is near 1 if no cluster would rather lie elsewhere, about 0 or less if their
  /// wishes have nothing to do with the pose nor with each other. It does not depend on the
  /// similarity's scale.
  double share = 0.0;
  /// The sum of what the clusters gain by the shared pose over the mean of the 27 translations,
  /// over the root of the sum of the squares of these gains: Student's t before its mean is taken
  /// off. Noise lowers the share above, however many clusters there are; what many of them say
  /// together stays sure. It is the root of their number at most, so that few of them never say
  /// much.
  double advantage = 0.0;
  /// Root mean square length, mm, of the translations that clusters near the centre and their
  /// neighbours together like best, by the rise that depends on it. It is 0 if nothing there makes
  /// a difference. Wrong poses have much of it.
  double tissue_motion_mm = 0.0;
  /// The same of wider groups: what a cluster and its neighbours reach together, added up over it
  /// and its neighbours once more, as far as they are near the centre. Where noise or a low
  /// contrast let small groups wish anything, it averages out over these. A motion that differs
  /// within such a group does, too.
  double wide_motion_mm = 0.0;
  /// `deformation_mm` of the peaks between these translations: about how far tissue there has moved
  /// relative to the pose.
  double deformation_mm = 0.0;
  /// `rigid_motion` of the same peaks of all clusters: a pose moved by it (to its left) lies where
  /// most of them would rather lie together.
  Eigen::Isometry3d wished_motion = Eigen::Isometry3d::Identity();
};

/// Unset for a similarity without parts, and where no translation makes a difference.
std::optional<LocalAgreement> local_agreement(const Similarity& similarity, const Candidate& pose,
                                              const LocalAgreementOptions& options, Run& run);

}  // namespace usct::registration
