#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/optimizer/optimizer.h"
#include "us_ct_registration/registration/registration_result.h"
#include "us_ct_registration/registration/starts.h"
#include "us_ct_registration/similarity/patch_similarity.h"
#include "us_ct_registration/simulation/conditioning.h"
#include "us_ct_registration/volume/volume.h"

/// Registers a CT to ultrasound: coarse to fine, from many starts to one pose.
namespace usct {

/// One stage from coarse to fine. Candidates come in (the initial pose, or what the stage before
/// kept), are spread if there are starts, the best are optimised, and the best distinct ones of
/// these are handed on.
struct StageOptions {
  /// Ultrasound samples and CT voxels are averaged to about this spacing.
  double spacing_mm = 2.0;
  SimilarityOptions similarity;
  /// Around each candidate; none: the candidates themselves.
  std::optional<StartOptions> starts;
  /// How many of them are optimised, best first; >= 1.
  int optimised = 1;
  /// How many distinct optima are handed on; >= 1.
  int kept = 1;
  OptimizerOptions optimizer;
  /// Farthest that an optimiser may go from where it starts, mm.
  double reach_mm = 20.0;
  /// Estimate AcquisitionErrors along with the pose: how far each may be from 0; 0: not estimated.
  double depth_error = 0.0;
  double sweep_error = 0.0;

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source) const;
};

struct RegistrationOptions {
  /// CT values that count, and what lies outside the CT.
  HuWindow window;
  double outside_hu = 40.0;
  /// The ultrasound is averaged to about this spacing before it is conditioned.
  double conditioning_spacing_mm = 1.0;
  ConditioningOptions conditioning;
  /// Coarse to fine; at least one.
  std::vector<StageOptions> stages;
  /// Optima closer than this (mean displacement of the field of view) are one.
  double distinct_mm = 3.0;
  std::uint32_t seed = 1;

  void validate(const std::string& source = "registration options") const;
};

struct RegistrationHooks {
  std::function<bool()> cancelled;
  std::function<void(double fraction)> progress;
};

RegistrationResult register_ultrasound(const BeamUltrasound& ultrasound, const CtVolume& ct,
                                       const Eigen::Isometry3d& T_us_ct_initial,
                                       const RegistrationOptions& options,
                                       const RegistrationHooks& hooks = {});

}  // namespace usct
