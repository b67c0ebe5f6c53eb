#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "registration/run.h"
#include "us_ct_registration/similarity/similarity.h"

namespace usct::registration {

/// How far clusters of the ultrasound agree with a pose that they share. Each cluster could reach a
/// higher similarity by a translation of its own, of -step_mm, 0 or step_mm along each axis of the
/// US frame. The share of the rise in reach is the rise of the similarity above the mean over these
/// 27 translations, as the shared pose reaches it, over the rise that the clusters reach with the
/// best translation of each. It does not depend on the scale of the similarity.
///
/// A rigid motion makes a wrong pose an optimum of the whole; it has six parameters and cannot do
/// so for each of a hundred clusters. Among n clusters that have nothing to do with the pose chance
/// makes up a share in proportion to 1 / sqrt(n), as the best of many sums of n random terms. The
/// result is the share less 1 / sqrt(n): near 1 if no cluster would rather lie elsewhere, and about
/// 0 or less if their wishes have nothing to do with the pose.
///
/// Unset for a similarity without parts, and where no translation makes a difference.
std::optional<double> local_agreement(const Similarity& similarity,
                                      const Eigen::Isometry3d& T_us_ct, double cluster_mm,
                                      double step_mm, Run& run);

}  // namespace usct::registration
