#pragma once

#include <Eigen/Geometry>
#include <functional>

#include "us_ct_registration/registration/registration_options.h"
#include "us_ct_registration/registration/registration_result.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// What a caller may do while a registration runs; both may be empty.
struct RegistrationHooks {
  /// Asked often, from several threads, one at a time; true ends the registration as kCancelled.
  std::function<bool()> cancelled;
  /// Told the fraction of the work that is done, in [0, 1], rising, never from two threads at once.
  std::function<void(double fraction)> progress;
};

/// Finds the pose at which a CT explains ultrasound best, and says whether to believe it.
///
/// Ultrasound is averaged, masked and freed of gain (`condition`); the part of the CT that the
/// search can reach is cropped and averaged, stage by stage. From the starts around the initial
/// pose the stages keep the most similar poses, coarse to fine; the optima of the last but one are
/// ranked, and the last polishes the first of them. Then the gates of ConfidenceOptions: what does
/// not pass comes back as kLowConfidence or kNoOverlap, without a transform but with its
/// candidates.
///
/// Data that cannot be registered (no overlap, nothing in the ultrasound that counts or varies, no
/// evaluation allowed, a pose that is not finite) are no error but a status and a message. Throws
/// InputError for invalid options, a CT or beams that are malformed, and an initial pose that is
/// not rigid.
///
/// The same bits for the same input, options and seed, with any number of threads.
RegistrationResult register_ultrasound(const BeamUltrasound& ultrasound, const CtVolume& ct,
                                       const Eigen::Isometry3d& T_us_ct_initial,
                                       const RegistrationOptions& options,
                                       const RegistrationHooks& hooks = {});

}  // namespace usct
