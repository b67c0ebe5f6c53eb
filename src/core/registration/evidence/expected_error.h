#pragma once

#include <vector>

#include "registration/evidence/field_axes.h"
#include "registration/evidence/parts.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct::registration {

/// The recorded frames of a tracked sweep from the first to the last that has samples which count
/// in the conditioned ultrasound: the probe may have come through the air. Each of them is the
/// recorded frame that lies nearest to one of the conditioned ultrasound, which averages several.
/// All frames of a motor's sweep.
BeamGrid frames_that_count(const BeamGrid& recorded, const BeamUltrasound& conditioned);

/// Covariance of a small motion (rotation vector in rad and translation in mm, in the US frame,
/// about its origin: p -> p + w x p + t) that follows a pose. With d the motion between the poses
/// of two halves, the mean of the halves has the covariance d d^T / 4: a covariance by clusters,
/// which needs no assumption on how errors within a half are correlated. Added to it are errors
/// of the recorded beams that move the field, and that the pose makes up for: a wrong speed of
/// sound shifts it along the beams, in proportion to its depth, and a lag between images and poses
/// along a tracked sweep, by frames that move (see moving_frames). Of `estimated`, a depth error
/// counts if it is more than that of the options: the estimate is biased, so that it must be 0
/// where the images do not show one. A sweep error s is thought to be that of one side of the
/// middle frame, which has twice as much while the other side has none: the best pose then lies a
/// quarter of s times the path of the sweep off.
Eigen::Matrix<double, 6, 6> pose_covariance(const std::vector<HalfPoses>& halves,
                                            const BeamGrid& recorded,
                                            const Eigen::Vector3d& centre_us_mm,
                                            const ErrorOptions& options,
                                            const AcquisitionErrors& estimated = {});

/// The covariance of a shift in any direction whose root mean square length is `rms_mm`.
Eigen::Matrix<double, 6, 6> shift_covariance(double rms_mm);

}  // namespace usct::registration
