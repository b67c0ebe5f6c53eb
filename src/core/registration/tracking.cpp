#include "us_ct_registration/registration/tracking.h"

#include "registration/as_patient.h"
#include "registration/pipeline.h"
#include "require.h"

namespace usct {

/// The last full registration that was accepted.
struct RegistrationTracker::Known {
  registration::Trail trail;
  /// Whether it went on as the preset `patient`, which those that follow it then do at once.
  bool by_patient = false;
  std::uint64_t ct = 0;
  AxialSampling axial;
  int lines = 0;
  int frames = 0;
  /// Registrations since then.
  int followed = 0;
};

void TrackingOptions::validate(const std::string& source) const {
  require(full_every >= 1, source, "full_every", full_every, ">= 1");
  require(reach_mm >= 0.0, source, "reach_mm", reach_mm, ">= 0");
}

RegistrationTracker::RegistrationTracker(const RegistrationOptions& options,
                                         const TrackingOptions& tracking)
    : options_(options), tracking_(tracking) {
  options_.validate();
  tracking_.validate();
}

RegistrationTracker::~RegistrationTracker() = default;

void RegistrationTracker::forget() { known_.reset(); }

bool RegistrationTracker::is_known(const BeamUltrasound& ultrasound, const PreparedCt& ct) const {
  const BeamGrid& beams = ultrasound.beams;
  return known_ && known_->ct == ct.number() && known_->lines == beams.lines &&
         known_->frames == beams.frames && known_->axial.samples == beams.axial.samples &&
         known_->axial.depth_mm(0.0) == beams.axial.depth_mm(0.0) &&
         known_->axial.depth_mm(1.0) == beams.axial.depth_mm(1.0);
}

RegistrationResult RegistrationTracker::next(const BeamUltrasound& ultrasound, const PreparedCt& ct,
                                             const Eigen::Isometry3d& T_us_ct_initial,
                                             const RegistrationHooks& hooks) {
  if (!is_known(ultrasound, ct) || ++known_->followed >= tracking_.full_every) known_.reset();
  const bool by_patient = known_ && known_->by_patient;
  const RegistrationOptions options = by_patient ? registration::as_patient(options_) : options_;
  std::optional<registration::Lead> lead;
  if (known_) lead.emplace(registration::Lead{known_->trail, tracking_.reach_mm});
  const registration::Registration ended = registration::run_pipeline(
      {ultrasound, ct, T_us_ct_initial, options}, hooks, lead ? &*lead : nullptr);
  // A search may have been made for a correction of the sweep that did not hold.
  if (!ended.was_tracked) known_.reset();
  if (ended.trail)
    known_ = std::make_unique<Known>(Known{*ended.trail, by_patient || ended.by_patient,
                                           ct.number(), ultrasound.beams.axial,
                                           ultrasound.beams.lines, ultrasound.beams.frames, 0});
  return ended.result;
}

}  // namespace usct
