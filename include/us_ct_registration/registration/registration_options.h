#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/optimizer/optimizer.h"
#include "us_ct_registration/registration/starts.h"
#include "us_ct_registration/similarity/patch_similarity.h"
#include "us_ct_registration/simulation/simulation.h"
#include "us_ct_registration/ultrasound/conditioning.h"
#include "us_ct_registration/volume/hu_window.h"

namespace usct {

/// One stage from coarse to fine. Candidates come in (the initial pose, or what the stage before
/// kept), are spread if there are starts, the best are optimised, and the best distinct ones of
/// these are handed on.
struct StageOptions {
  /// Ultrasound samples and CT voxels are averaged to about this spacing.
  double spacing_mm = 2.0;
  SimilarityOptions similarity;
  /// Around the initial pose; only the first stage may have some.
  std::optional<StartOptions> starts;
  /// How many of the candidates are optimised, best first; >= 1.
  int optimised = 1;
  /// How many distinct optima are handed on; >= 1.
  int kept = 1;
  /// Its seed is not used: RegistrationOptions::seed is.
  OptimizerOptions optimizer;
  /// Farthest that an optimizer may go from where it starts, along each pose parameter, mm.
  double reach_mm = 20.0;
  /// Estimate AcquisitionErrors along with the pose: how far each may be from 0; 0: not estimated.
  /// Only the last stage may.
  double depth_error = 0.0;
  double sweep_error = 0.0;

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source) const;
};

/// When a registration is believed. Poses spread like the starts, away from the best one, show what
/// a similarity is worth where nothing fits: its value at the best pose is judged in standard
/// deviations above their mean. (The value itself says little: it depends on noise, contrast and
/// the field of view.)
struct ConfidenceOptions {
  /// Least share of the ultrasound in the CT; [0, 1].
  double min_overlap = 0.2;
  /// How many poses; >= 16.
  int background = 64;
  /// ... and how far they are spread where the first stage has no starts, mm; > 0.
  double background_mm = 25.0;
  /// Of the decisive stage's similarity (the last but one; the only one if there is one).
  double min_significance = 8.0;
  /// How much worse the best rival elsewhere (over 10 mm away) must be: the difference as a share
  /// of the best one's height above the background; [0, 1]. What scatters too much is no rival.
  double min_margin = 0.1;
  /// The last stage may move the decisive stage's optimum by this much, mm (mean displacement).
  double max_disagreement_mm = 5.0;
  /// Greatest distance from the initial pose, mm (mean displacement); infinite: any.
  double max_displacement_mm = std::numeric_limits<double>::infinity();
  /// A second similarity, on the images of the decisive stage, that did not choose the pose. Its
  /// parts may pull the pose apart by this much, mm (root mean square displacement of the field of
  /// view): where the pose is right they agree, where it only looks right they do not.
  SimilarityOptions confirmation;
  double max_scatter_mm = 0.5;
  /// Covariance: factor on the standard deviations that the ultrasound's patches give (they are not
  /// independent, and err together), and what no image shows: shift of the field (root mean square)
  /// by sound speed, deformation and the like, mm. Both by calibration (docs/accuracy.md).
  double deviation_factor = 4.0;
  double systematic_mm = 0.8;

  void validate(const std::string& source) const;
};

struct RegistrationOptions {
  /// CT values that count, and what lies outside the CT.
  HuWindow window;
  double outside_hu = 40.0;
  /// The ultrasound is averaged to about this spacing before it is conditioned.
  double conditioning_spacing_mm = 1.0;
  ConditioningOptions conditioning;
  /// Of the similarity `simulated_lc2`, the thesis'.
  SimulationOptions simulation;
  FitOptions fit;
  /// Coarse to fine; at least one. All but the last are the search.
  std::vector<StageOptions> stages;
  /// Where the search finds nothing that passes the gates, it goes on: each round has four times
  /// the starts of the one before, and optimises and keeps at least four times as many; every other
  /// one spreads them half as far and climbs at the decisive stage alone; [1, 6].
  int rounds = 1;
  /// Optima closer than this (mean displacement of the field of view) are one, mm.
  double distinct_mm = 4.0;
  ConfidenceOptions confidence;
  std::uint32_t seed = 1;

  /// Throws InputError, naming `source`, the field, its value and the constraint.
  void validate(const std::string& source = "registration options") const;
};

}  // namespace usct
