#pragma once

#include <optional>

#include "registration/trail.h"
#include "us_ct_registration/registration/registration.h"

namespace usct::registration {

/// A registration, and what it leaves for the next one.
struct PipelineResult {
  RegistrationResult result;
  /// A full registration leaves one if it was accepted and has evidence on its own images.
  std::optional<Trail> trail;
  /// Whether the registration went on as the preset `patient`.
  bool by_patient = false;
};

/// The pipeline of `register_ultrasound`. With a trail it is followed first, unless the initial
/// pose is over `reach_mm` from it; the search begins if that finds no pose that is accepted. With
/// EvidenceSource::kOwnFirst, the first round ends it if its pose is beyond doubt; else the result
/// is that of the preset `patient`.
PipelineResult run_pipeline(const BeamUltrasound& ultrasound, const PreparedCt& ct,
                            const Eigen::Isometry3d& T_us_ct_initial,
                            const RegistrationOptions& options, const RegistrationHooks& hooks,
                            const Trail* trail = nullptr, double reach_mm = 0.0);

}  // namespace usct::registration
