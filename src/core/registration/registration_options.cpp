#include "us_ct_registration/registration/registration_options.h"

#include <cmath>

#include "require.h"

namespace usct {
namespace {

OptimizerOptions bobyqa(double initial_step, double step_tolerance) {
  OptimizerOptions optimizer;
  optimizer.method = OptimizerMethod::kBobyqa;
  optimizer.max_evaluations = 300;
  optimizer.initial_step = initial_step;
  optimizer.step_tolerance = step_tolerance;
  return optimizer;
}

PatchOptions patches(double depth_mm, double across_mm) {
  PatchOptions options;
  options.depth_mm = depth_mm;
  options.lateral_mm = options.elevation_mm = across_mm;
  return options;
}

/// The search: one function of CT value and gradient explains the ultrasound everywhere, on 4 mm
/// from many starts, then on 2 mm.
std::vector<LevelOptions> patient_levels() {
  JointCorrelationRatioOptions metric;
  LevelOptions coarse;
  metric.patches = patches(16.0, 22.0);
  coarse.spacing_mm = 4.0;
  coarse.similarity = metric;
  coarse.optimizer = bobyqa(4.0, 0.2);
  coarse.optimised = 12;
  coarse.kept = 4;
  LevelOptions deciding;
  metric.patches = patches(8.0, 11.0);
  deciding.similarity = metric;
  deciding.optimizer = bobyqa(2.0, 0.1);
  deciding.optimised = 4;
  deciding.kept = 5;
  return {coarse, deciding};
}

/// The refinement: patches explain the ultrasound, and need not agree on one function.
RefinementOptions patient_refinement() {
  LocalLc2Options metric;
  metric.patches = patches(4.0, 5.6);
  metric.pressed_mm = 40.0;
  RefinementOptions refinement;
  refinement.spacing_mm = 1.0;
  refinement.similarity = metric;
  refinement.optimizer = bobyqa(1.0, 0.05);
  return refinement;
}

/// The second similarity: almost without a ridge faint structure counts as well as edges, and
/// gradients may darken, so that misfits show.
LocalLc2Options patient_scatter() {
  LocalLc2Options metric;
  metric.patches = patches(6.0, 8.0);
  metric.pressed_mm = 40.0;
  metric.ridge_intensity_hu = 2.5;
  metric.ridge_gradient_hu_per_mm = 5.0;
  metric.positive_gradient = false;
  return metric;
}

}  // namespace

RegistrationOptions::RegistrationOptions() {
  conditioning.smoothing_mm = 0.0;
  conditioning.window_mm = 4.0;
  search.levels = patient_levels();
  refinement = patient_refinement();
  confidence.scatter.similarity = patient_scatter();
}

void ClimbOptions::validate(const std::string& source) const {
  if (spacing_mm) require_positive(source, "spacing_mm", *spacing_mm);
  usct::validate(similarity, source + ".similarity");
  optimizer.validate(source + ".optimizer");
  // Every optimizer needs these properties of its box.
  require(std::isfinite(reach_mm) && reach_mm >= 2.0 * optimizer.step_tolerance, source, "reach_mm",
          reach_mm, "finite and >= twice optimizer.step_tolerance");
}

void LevelOptions::validate(const std::string& source) const {
  ClimbOptions::validate(source);
  require(optimised >= 1, source, "optimised", optimised, ">= 1");
  require(kept >= 1, source, "kept", kept, ">= 1");
}

void RoundOptions::validate(const std::string& source) const {
  require_within(source, "most", most, 1, 6);
  require_within(source, "growth", growth, 1, 16);
  require_within(source, "breadth", breadth, 1, 64);
  require_within(source, "deciding_breadth", deciding_breadth, 1, 64);
  require(near_share > 0.0 && near_share <= 1.0, source, "near_share", near_share, "within (0, 1]");
}

void SearchOptions::validate(const std::string& source) const {
  if (starts) starts->validate(source + ".starts");
  require(!levels.empty(), source, "levels", 0.0, "one at least");
  for (std::size_t i = 0; i < levels.size(); ++i)
    levels[i].validate(source + ".levels[" + std::to_string(i) + "]");
  rounds.validate(source + ".rounds");
  require_not_negative(source, "distinct_mm", distinct_mm);
  require(most_optima >= 1, source, "most_optima", most_optima, ">= 1");
  require_not_negative(source, "ct_margin_mm", ct_margin_mm);
  require_positive(source, "ct_most_turn_rad", ct_most_turn_rad);
}

void RefinementOptions::validate(const std::string& source) const {
  ClimbOptions::validate(source);
  require_not_negative(source, "ct_margin_mm", ct_margin_mm);
  constexpr double kMostError = 0.2;
  require_within(source, "depth_error", depth_error, 0.0, kMostError);
  require_within(source, "sweep_error", sweep_error, 0.0, kMostError);
  const SimilarityNeeds needs = needs_of(similarity);
  const std::string only = std::string("0: ") + similarity_name(similarity) + " cannot follow it";
  require(depth_error == 0.0 || needs.follows_depth_error, source, "depth_error", depth_error,
          only);
  require(sweep_error == 0.0 || needs.follows_sweep_error, source, "sweep_error", sweep_error,
          only);
}

void BackgroundOptions::validate(const std::string& source) const {
  require(count >= 16, source, "count", count, ">= 16");
  require_positive(source, "spread_rad", spread_rad);
  require_positive(source, "spread_mm", spread_mm);
  require_not_negative(source, "away_mm", away_mm);
}

void ScatterOptions::validate(const std::string& source) const {
  usct::validate(similarity, source + ".similarity");
  require_positive(source, "around_mm", around_mm);
  require(least_curvature > 0.0 && least_curvature <= 1.0, source, "least_curvature",
          least_curvature, "within (0, 1]");
}

void ConfidenceOptions::validate(const std::string& source) const {
  gates.validate(source + ".gates");
  background.validate(source + ".background");
  require_not_negative(source, "rival_mm", rival_mm);
  scatter.validate(source + ".scatter");
  require_positive(source, "deviation_factor", deviation_factor);
  require_not_negative(source, "systematic_mm", systematic_mm);
}

void RegistrationOptions::validate(const std::string& source) const {
  window.validate(source + ".window");
  require(outside_hu >= window.low_hu && outside_hu <= window.high_hu, source, "outside_hu",
          outside_hu, "within the window");
  if (conditioning_spacing_mm)
    require_positive(source, "conditioning_spacing_mm", *conditioning_spacing_mm);
  conditioning.validate(source + ".conditioning");
  search.validate(source + ".search");
  if (refinement) refinement->validate(source + ".refinement");
  confidence.validate(source + ".confidence");
}

}  // namespace usct
