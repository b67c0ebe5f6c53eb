#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <string>

#include "us_ct_registration/registration/registration.h"

namespace usct {

struct TrackingOptions {
  /// One of so many registrations is a full one, so that evidence that has appeared since the last
  /// full one is not overlooked for long; >= 1. 1: all of them are.
  int full_every = 10;
  /// If the field of view has moved in the CT by more than this since the last full registration
  /// (mean displacement), the next one is full as well, since the field shows other tissue; >= 0,
  /// mm.
  double reach_mm = 20.0;

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "tracking options") const;
};

/// Registers one ultrasound after the other to the same CT, faster than `register_ultrasound` while
/// the pose is known. A full registration is one by `register_ultrasound`. If it is accepted, its
/// mirrored ultrasound and its rivals are kept. The next registrations climb from the initial pose,
/// and from these in place of a search; the pose is refined and judged as ever. If it is refused,
/// or a rival is more similar, the registration goes on as a full one.
///
/// Only such ultrasound is tracked that has the sampling, the lines and the frames of the last full
/// registration's, and with the same PreparedCt. Without evidence in the options, or with evidence
/// on other images than those of the registration, all registrations are full.
class RegistrationTracker {
 public:
  /// Throws InputError for invalid options.
  explicit RegistrationTracker(const RegistrationOptions& options,
                               const TrackingOptions& tracking = {});
  ~RegistrationTracker();
  RegistrationTracker(const RegistrationTracker&) = delete;
  RegistrationTracker& operator=(const RegistrationTracker&) = delete;

  /// As `register_ultrasound`. `T_us_ct_initial` must be a pose that was accepted, seen from where
  /// the probe is now: it is believed if the evidence allows it. The time of the step `tracking` is
  /// in the result if it was tried, that of `search` if the registration was full.
  RegistrationResult next(const BeamUltrasound& ultrasound, const PreparedCt& ct,
                          const Eigen::Isometry3d& T_us_ct_initial,
                          const RegistrationHooks& hooks = {});

  /// The next registration is full.
  void forget();

 private:
  struct Known;

  bool is_known(const BeamUltrasound& ultrasound, const PreparedCt& ct) const;

  const RegistrationOptions options_;
  const TrackingOptions tracking_;
  std::unique_ptr<Known> known_;
};

}  // namespace usct
