#pragma once

#include <Eigen/Geometry>
#include <functional>

#include "us_ct_registration/registration/prepared_ct.h"
#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/registration/registration_result.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// Callbacks while a registration runs; both may be empty.
struct RegistrationHooks {
  /// Called often, from several threads, one at a time; true ends the registration as kCancelled.
  std::function<bool()> cancelled;
  /// Receives the fraction of the work done, in [0, 1], never decreasing, from one thread at a
  /// time.
  std::function<void(double fraction)> progress;
};

/// Finds the pose at which a CT explains ultrasound best, and judges whether to believe it.
///
/// Prepare: the ultrasound is averaged, masked and freed of gain (`condition`); the part of the CT
/// that the search can reach is cropped, and both images are averaged level by level. Search: from
/// starts around the initial pose the levels keep the most similar poses, coarse to fine; the last
/// level ranks its optima. Refine: the best of them is climbed on finer images. Assess and judge:
/// the measures of the pose must pass ConfidenceOptions::gates; otherwise the search goes on in
/// another round. A pose that fails is returned as kLowConfidence or kNoOverlap, without a
/// transform but with its candidates.
///
/// Data that cannot be registered (no overlap, ultrasound without samples that count or vary, no
/// evaluation allowed, a pose that is not finite) give a status and a message, not an error. Throws
/// InputError for invalid options, a CT or beams that are malformed or of another kind than the
/// options are for, a tracked sweep whose field of view jumps by more than 200 mm from one frame to
/// the next, and an initial pose that is not rigid.
///
/// A caller that registers one CT many times can prepare it once, and pass the PreparedCt here. The
/// result has the same bits for the same input, options and seed, with any number of threads.
RegistrationResult register_ultrasound(const BeamUltrasound& ultrasound, const PreparedCt& ct,
                                       const Eigen::Isometry3d& T_us_ct_initial,
                                       const RegistrationOptions& options,
                                       const RegistrationHooks& hooks = {});

}  // namespace usct
