#include "us_ct_registration/registration/registration_options.h"

#include <cmath>

#include "registration/evidence_plan.h"
#include "registration/search/candidates.h"
#include "require.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"

namespace usct {
namespace {

OptimizerOptions climb_by(OptimizerMethod method, double initial_step, double step_tolerance) {
  OptimizerOptions optimizer;
  optimizer.method = method;
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
/// by half of the samples from many starts, then on 2 mm.
std::vector<LevelOptions> patient_levels() {
  JointCorrelationRatioOptions metric;
  LevelOptions coarse;
  metric.patches = patches(16.0, 22.0);
  metric.patches.samples = SampleSubset::kHalf;
  coarse.spacing_mm = 4.0;
  coarse.similarity = metric;
  coarse.optimizer = climb_by(OptimizerMethod::kGaussNewton, 4.0, 0.5);
  coarse.screened = 64;
  coarse.optimised = 24;
  coarse.kept = 4;
  LevelOptions deciding;
  metric.patches = patches(8.0, 11.0);
  deciding.similarity = metric;
  deciding.optimizer = climb_by(OptimizerMethod::kGaussNewton, 2.0, 0.4);
  deciding.screened = 64;
  deciding.optimised = 4;
  deciding.kept = 5;
  return {coarse, deciding};
}

/// The refinement: patches explain the ultrasound, and need not agree on one function.
RefinementOptions patient_refinement() {
  LocalLc2Options metric;
  metric.patches = patches(4.0, 5.6);
  metric.patches.samples = SampleSubset::kHalf;
  metric.pressed_mm = 40.0;
  RefinementOptions refinement;
  refinement.spacing_mm = 1.0;
  refinement.similarity = metric;
  refinement.optimizer = climb_by(OptimizerMethod::kGaussNewton, 1.0, 0.05);
  return refinement;
}

/// Patches of the evidence. With hardly any ridge, gradients may darken as well, so that misfits
/// show.
LocalLc2Options patient_evidence(bool with_ridge) {
  LocalLc2Options metric;
  metric.patches = patches(6.0, 8.0);
  metric.pressed_mm = 40.0;
  if (with_ridge) return metric;
  metric.ridge_intensity_hu = 2.5;
  metric.ridge_gradient_hu_per_mm = 5.0;
  metric.positive_gradient = false;
  return metric;
}

/// Throws InputError if the optimizer needs derivatives that the similarity does not have.
void require_derivatives(const OptimizerOptions& optimizer, const SimilarityOptions& similarity,
                         const std::string& source, const std::string& field) {
  if (optimizer.method == OptimizerMethod::kGaussNewton && !needs_of(similarity).has_derivatives)
    throw InputError(source, "'" + field +
                                 "' is 'gauss_newton', must be another: the similarity has no "
                                 "derivatives (joint_correlation_ratio has, and local_lc2 with "
                                 "the channel magnitude)");
}

}  // namespace

RegistrationOptions::RegistrationOptions() {
  conditioning.smoothing_mm = 0.0;
  conditioning.window_mm = 4.0;
  search.levels = patient_levels();
  refinement = patient_refinement();
  confidence.similarity = patient_evidence(false);
  confidence.ridge_similarity = patient_evidence(true);
  confidence.parts.optimizer = climb_by(OptimizerMethod::kGaussNewton, 1.0, 0.2);
}

void ClimbOptions::validate(const std::string& source) const {
  if (spacing_mm) require_positive(source, "spacing_mm", *spacing_mm);
  usct::validate(similarity, source + ".similarity");
  optimizer.validate(source + ".optimizer");
  require_derivatives(optimizer, similarity, source, "optimizer.method");
  // Every optimizer needs these properties of its box.
  require(std::isfinite(reach_mm) && reach_mm >= 2.0 * optimizer.step_tolerance, source, "reach_mm",
          reach_mm, "finite and >= twice optimizer.step_tolerance");
}

void LevelOptions::validate(const std::string& source) const {
  ClimbOptions::validate(source);
  require(optimised >= 1, source, "optimised", optimised, ">= 1");
  require(kept >= 1, source, "kept", kept, ">= 1");
  if (screened) require(*screened >= optimised, source, "screened", *screened, ">= optimised");
}

void SearchOptions::validate(const std::string& source) const {
  if (starts) starts->validate(source + ".starts");
  require(!levels.empty(), source, "levels", 0.0, "one at least");
  for (std::size_t i = 0; i < levels.size(); ++i)
    levels[i].validate(source + ".levels[" + std::to_string(i) + "]");
  for (std::size_t i = 1; i < levels.size(); ++i) {
    const double spacing_mm = levels[i].spacing_mm.value_or(0.0);
    const double before_mm = levels[i - 1].spacing_mm.value_or(0.0);
    const std::string field = "levels[" + std::to_string(i) + "].spacing_mm";
    require(spacing_mm <= before_mm, source, field, spacing_mm,
            "at most that of the level before, " + formatted("%g", before_mm) +
                ": levels go from coarse to fine (none: 0)");
  }
  require_within(source, "rounds", rounds, 1, 32);
  require_not_negative(source, "distinct_mm", distinct_mm);
  require(most_optima >= 1, source, "most_optima", most_optima, ">= 1");
  require_not_negative(source, "ct_margin_mm", ct_margin_mm);
  require_positive(source, "ct_most_turn_rad", ct_most_turn_rad);
}

void RefinementOptions::validate(const std::string& source) const {
  ClimbOptions::validate(source);
  require_not_negative(source, "ct_margin_mm", ct_margin_mm);
}

void PartOptions::validate(const std::string& source) const {
  optimizer.validate(source + ".optimizer");
  require(std::isfinite(reach_mm) && reach_mm >= 2.0 * optimizer.step_tolerance, source, "reach_mm",
          reach_mm, "finite and >= twice optimizer.step_tolerance");
}

void ErrorOptions::validate(const std::string& source) const {
  require_positive(source, "parts_factor", parts_factor);
  constexpr double kMostShare = 0.2;
  require_within(source, "sound_speed_share", sound_speed_share, 0.0, kMostShare);
  require_within(source, "sweep_share", sweep_share, 0.0, kMostShare);
  require_not_negative(source, "lag_frames", lag_frames);
  require_not_negative(source, "other_mm", other_mm);
  require_positive(source, "bound_factor", bound_factor);
  require_positive(source, "target_radius_mm", target_radius_mm);
}

void ConfidenceOptions::validate(const std::string& source) const {
  gates.validate(source + ".gates");
  // A pose that is found again some tenths beside itself is no rival.
  constexpr double kLeastRivalMm = 1.0;
  require(std::isfinite(rival_mm) && rival_mm >= kLeastRivalMm, source, "rival_mm", rival_mm,
          "finite and >= 1");
  usct::validate(similarity, source + ".similarity");
  usct::validate(ridge_similarity, source + ".ridge_similarity");
  require_positive(source, "cluster_mm", cluster_mm);
  require_positive(source, "cluster_step_mm", cluster_step_mm);
  parts.validate(source + ".parts");
  require_derivatives(parts.optimizer, similarity, source, "parts.optimizer.method");
  require_derivatives(parts.optimizer, ridge_similarity, source, "parts.optimizer.method");
  error.validate(source + ".error");
}

namespace {

/// Evidence mirrors the images of the search, and compares patch by patch. Whole beams cannot be
/// mirrored.
void require_evidence(const RegistrationOptions& options, const std::string& source) {
  const auto refuse = [&](const std::string& option, const SimilarityOptions& similarity,
                          const std::string& instead) {
    throw InputError(
        source, "'" + option + "' is " + similarity_name(similarity) +
                    ", which gives no evidence for the gate 'max_wrong_probability': " + instead);
  };
  const ConfidenceOptions& confidence = options.confidence;
  const std::vector<LevelOptions>& levels = options.search.levels;
  for (std::size_t i = 0; i < levels.size(); ++i)
    if (!registration::EvidencePlan(confidence).is_judged_as_patient() &&
        needs_of(levels[i].similarity).recorded_ct)
      refuse("search.levels[" + std::to_string(i) + "].similarity", levels[i].similarity,
             "'confidence.evidence' must be patient");
  for (const auto& [option, similarity] :
       {std::pair("confidence.similarity", &confidence.similarity),
        std::pair("confidence.ridge_similarity", &confidence.ridge_similarity)})
    if (!needs_of(*similarity).has_parts)
      refuse(option, *similarity, "it must be a sum over patches, which local_lc2 is");
}

}  // namespace

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
  if (confidence.gates.max_wrong_probability) require_evidence(*this, source);
}

}  // namespace usct
