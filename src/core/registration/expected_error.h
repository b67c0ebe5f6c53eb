#pragma once

#include <vector>

#include "registration/field_axes.h"
#include "registration/parts.h"

namespace usct::registration {

/// Covariance of a small motion (rotation vector in rad and translation in mm, in the US frame,
/// about its origin: p -> p + w x p + t) that follows a pose. With d the motion between the poses
/// of two halves, the mean of the halves has the covariance d d^T / 4: a covariance by clusters,
/// which needs no assumption on how errors within a half are correlated. Added to it are errors
/// that no image shows; they are those of the recorded beams: a wrong speed of sound shifts the
/// field along the beams, in proportion to its depth, and a lag between images and poses shifts it
/// along a tracked sweep.
Eigen::Matrix<double, 6, 6> pose_covariance(const std::vector<HalfPoses>& halves,
                                            const BeamGrid& recorded,
                                            const Eigen::Vector3d& centre_us_mm,
                                            const ErrorOptions& options);

/// The covariance of a shift in any direction whose root mean square length is `rms_mm`.
Eigen::Matrix<double, 6, 6> shift_covariance(double rms_mm);

}  // namespace usct::registration
