#pragma once

#include <array>
#include <string>
#include <utility>

#include "us_ct_registration/error.h"
#include "us_ct_registration/registration/registration.h"
#include "us_ct_registration/simulation/simulation.h"

namespace usct {

/// Words for the enumerations of the lower layers.
constexpr auto words_of(Normalisation) {
  return std::array<std::pair<Normalisation, const char*>, 3>{
      {{Normalisation::kNone, "none"},
       {Normalisation::kFlatten, "flatten"},
       {Normalisation::kZScore, "z_score"}}};
}
constexpr auto words_of(Interpolation) {
  return std::array<std::pair<Interpolation, const char*>, 2>{
      {{Interpolation::kNearest, "nearest"}, {Interpolation::kTrilinear, "trilinear"}}};
}
constexpr auto words_of(LogCompression) {
  return std::array<std::pair<LogCompression, const char*>, 2>{
      {{LogCompression::kReflection, "reflection"}, {LogCompression::kIntensity, "intensity"}}};
}

}  // namespace usct

/// The one description of the option fields in files, which reading, writing and listing all use. A
/// new field is one line here (or beside its struct, as for the metrics and the gates), with its
/// unit in the key; a new enumeration is a table of words.
///
/// `fields(key, value)` is called for each field; `fields.degrees(key, value_rad, most_deg)` for
/// each angle, which files give in degrees.
namespace usct::io {

template <typename Enum>
std::string word_of(Enum value) {
  for (const auto& [known, word] : words_of(value))
    if (known == value) return word;
  throw std::logic_error("a value of an enumeration has no word");
}
inline std::string word_of(OptimizerMethod method) { return method_name(method); }

/// Throws InputError, naming `source`, for a word that is not in the table.
template <typename Enum>
void parse_word(const std::string& word, const std::string& source, Enum& value) {
  std::string all;
  for (const auto& [known, its_word] : words_of(value)) {
    if (word == its_word) {
      value = known;
      return;
    }
    all += (all.empty() ? "" : ", ") + std::string(its_word);
  }
  throw InputError(source, "is '" + word + "', must be one of " + all);
}
inline void parse_word(const std::string& word, const std::string& source,
                       OptimizerMethod& method) {
  method = parse_method(word, source);
}

template <typename Fields>
void describe(Fields& fields, HuWindow& o) {
  fields("low_hu", o.low_hu);
  fields("high_hu", o.high_hu);
}

template <typename Fields>
void describe(Fields& fields, DepthOptions& o) {
  fields("min_mm", o.min_mm);
  fields("max_mm", o.max_mm);
  fields("automatic", o.automatic);
  fields("near_field_mm", o.near_field_mm);
  fields("near_field_limit_mm", o.near_field_limit_mm);
  fields("far_wall_share", o.far_wall_share);
  fields("far_wall_margin_mm", o.far_wall_margin_mm);
}

template <typename Fields>
void describe(Fields& fields, ConditioningOptions& o) {
  fields("normalisation", o.normalisation);
  fields("smoothing_mm", o.smoothing_mm);
  fields("window_mm", o.window_mm);
  fields("least_deviation", o.least_deviation);
  fields("depth", o.depth);
  fields("saturated_grey", o.saturated_grey);
  fields("no_contact_share", o.no_contact_share);
  fields("shadow_share", o.shadow_share);
  fields("visible_grey", o.visible_grey);
  fields("min_shadow_mm", o.min_shadow_mm);
}

template <typename Fields>
void describe(Fields& fields, OcclusionOptions& o) {
  fields("by_threshold", o.by_threshold);
  fields("bone_hu", o.bone_hu);
  fields("gas_hu", o.gas_hu);
  fields("gradient_hu_per_mm", o.gradient_hu_per_mm);
  fields("echo_mm", o.echo_mm);
}

template <typename Fields>
void describe(Fields& fields, IntensityMap& o) {
  fields("slope", o.slope);
  fields("offset", o.offset);
  fields("clamp", o.clamp);
}

template <typename Fields>
void describe(Fields& fields, SimulationOptions& o) {
  fields("interpolation", o.interpolation);
  fields("outside_hu", o.outside_hu);
  fields("window", o.window);
  fields("hu_shift", o.hu_shift);
  fields("mu_floor", o.mu_floor);
  fields("gradient_length_mm", o.gradient_length_mm);
  fields("transmission_length_mm", o.transmission_length_mm);
  fields("occlusion", o.occlusion);
  fields("log_compression", o.log_compression);
  fields("log_a", o.log_a);
  fields("reflection_scale", o.reflection_scale);
  fields("signed_reflection", o.signed_reflection);
  fields("map", o.map);
}

template <typename Fields>
void describe(Fields& fields, SimulationWeights& o) {
  fields("mapped_ct", o.mapped_ct);
  fields("reflection", o.reflection);
  fields("bias", o.bias);
}

template <typename Fields>
void describe(Fields& fields, FitOptions& o) {
  fields("fixed_weights", o.fixed_weights);
  fields("use_background", o.use_background);
  fields("min_overlap", o.min_overlap);
}

template <typename Fields>
void describe(Fields& fields, StartOptions& o) {
  constexpr double kMostInBoxDeg = 103.92;
  constexpr double kMostDeg = 180.0;
  fields("region", o.region);
  fields("count", o.count);
  fields.degrees("rotation_deg", o.rotation_rad,
                 o.region == StartRegion::kBox ? kMostInBoxDeg : kMostDeg);
  fields("translation_mm", o.translation_mm);
}

/// The seed is left out: a registration passes its own on.
template <typename Fields>
void describe(Fields& fields, OptimizerOptions& o) {
  fields("method", o.method);
  fields("max_evaluations", o.max_evaluations);
  fields("initial_step", o.initial_step);
  fields("step_tolerance", o.step_tolerance);
  fields("cost_tolerance", o.cost_tolerance);
  fields("population", o.population);
}

template <typename Fields>
void describe(Fields& fields, ClimbOptions& o) {
  fields("spacing_mm", o.spacing_mm);
  fields("similarity", o.similarity);
  fields("optimizer", o.optimizer);
  fields("reach_mm", o.reach_mm);
}

template <typename Fields>
void describe(Fields& fields, LevelOptions& o) {
  describe(fields, static_cast<ClimbOptions&>(o));
  fields("screened", o.screened);
  fields("optimised", o.optimised);
  fields("kept", o.kept);
}

template <typename Fields>
void describe(Fields& fields, SearchOptions& o) {
  fields("starts", o.starts);
  fields("levels", o.levels);
  fields("rounds", o.rounds);
  fields("distinct_mm", o.distinct_mm);
  fields("most_optima", o.most_optima);
  fields("ct_margin_mm", o.ct_margin_mm);
  fields("ct_most_turn_rad", o.ct_most_turn_rad);
}

template <typename Fields>
void describe(Fields& fields, RefinementOptions& o) {
  describe(fields, static_cast<ClimbOptions&>(o));
  fields("ct_margin_mm", o.ct_margin_mm);
}

template <typename Fields>
void describe(Fields& fields, PartOptions& o) {
  fields("optimizer", o.optimizer);
  fields("reach_mm", o.reach_mm);
}

template <typename Fields>
void describe(Fields& fields, ErrorOptions& o) {
  fields("parts_factor", o.parts_factor);
  fields("sound_speed_share", o.sound_speed_share);
  fields("sweep_share", o.sweep_share);
  fields("lag_frames", o.lag_frames);
  fields("other_mm", o.other_mm);
  fields("bound_factor", o.bound_factor);
  fields("target_radius_mm", o.target_radius_mm);
}

template <typename Fields>
void describe(Fields& fields, ConfidenceOptions& o) {
  fields("gates", o.gates);
  fields("evidence", o.evidence);
  fields("rival_mm", o.rival_mm);
  fields("similarity", o.similarity);
  fields("ridge_similarity", o.ridge_similarity);
  fields("cluster_mm", o.cluster_mm);
  fields("cluster_step_mm", o.cluster_step_mm);
  fields("parts", o.parts);
  fields("error", o.error);
}

template <typename Fields>
void describe(Fields& fields, RegistrationOptions& o) {
  fields("beams", o.beams);
  fields("window", o.window);
  fields("outside_hu", o.outside_hu);
  fields("conditioning_spacing_mm", o.conditioning_spacing_mm);
  fields("conditioning", o.conditioning);
  fields("search", o.search);
  fields("refinement", o.refinement);
  fields("confidence", o.confidence);
  fields("correct_sweep", o.correct_sweep);
  fields("seed", o.seed);
}

}  // namespace usct::io
