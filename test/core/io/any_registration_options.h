#pragma once

#include <rapidcheck.h>

#include <algorithm>
#include <initializer_list>
#include <limits>
#include <optional>
#include <vector>

#include "us_ct_registration/registration/registration_options.h"

/// Random valid options. Structured bindings name every field of a struct, and the sizes of derived
/// structs are checked: a new field does not compile until it is here, and must then survive
/// writing and reading a file.
namespace usct::test {

inline double between(double low, double high) {
  constexpr int kSteps = 1 << 30;
  return low + (high - low) * *rc::gen::inRange(0, kSteps + 1) / kSteps;
}
template <typename Enum>
Enum one_of(std::initializer_list<Enum> values) {
  return *rc::gen::elementOf(std::vector<Enum>(values));
}
inline bool any_bool() { return *rc::gen::arbitrary<bool>(); }
inline int any_int(int low, int high) { return *rc::gen::inRange(low, high); }
inline double finite_or_infinite(double low, double high) {
  return any_bool() ? std::numeric_limits<double>::infinity() : between(low, high);
}
inline std::optional<double> maybe(double low, double high) {
  return any_bool() ? std::optional<double>() : between(low, high);
}

inline void randomise(HuWindow& o) {
  auto& [low_hu, high_hu] = o;
  low_hu = any_int(-1000, 0);
  high_hu = any_int(1, 3000);
}
inline void randomise(DepthOptions& o) {
  auto& [min_mm, max_mm, automatic, near_mm, near_limit_mm, share, margin_mm] = o;
  min_mm = maybe(0, 40);
  max_mm = maybe(41, 200);
  automatic = any_bool();
  near_mm = between(0, 20);
  near_limit_mm = between(0, 50);
  share = maybe(0.01, 1);
  margin_mm = between(0, 9);
}
inline void randomise(ConditioningOptions& o) {
  auto& [normalisation, smoothing, window, least, depth, saturated, contact, shadow, grey, length] =
      o;
  normalisation = one_of({Normalisation::kNone, Normalisation::kFlatten, Normalisation::kZScore});
  smoothing = between(0, 3);
  window = between(0.1, 20);
  least = between(0.01, 1);
  randomise(depth);
  saturated = maybe(1, 300);
  contact = between(0, 0.9);
  shadow = between(0, 0.9);
  grey = between(0, 255);
  length = between(0, 30);
}
inline void randomise(PatchOptions& o) {
  auto& [depth_mm, lateral_mm, elevation_mm, share, samples] = o;
  depth_mm = between(0.1, 50);
  lateral_mm = finite_or_infinite(0.1, 50);
  elevation_mm = between(0.1, 50);
  share = between(0.01, 1);
  samples = one_of({SampleSubset::kAll, SampleSubset::kHalf, SampleSubset::kQuarter});
}
inline void randomise(SimulationOptions& o) {
  auto& [interpolation, outside, window, shift, floor, length, transmission, occlusion, compression,
         log_a, scale, is_signed, map] = o;
  interpolation = one_of({Interpolation::kNearest, Interpolation::kTrilinear});
  outside = between(-100, 100);
  if (any_bool()) randomise(window.emplace());
  shift = between(900, 1100);
  floor = between(1, 100);
  length = between(0.1, 3);
  transmission = maybe(0.1, 3);
  occlusion.by_threshold = any_bool();
  occlusion.bone_hu = between(300, 900);
  occlusion.gas_hu = between(-900, -300);
  occlusion.gradient_hu_per_mm = finite_or_infinite(100, 900);
  occlusion.echo_mm = maybe(0.1, 10);
  compression = one_of({LogCompression::kReflection, LogCompression::kIntensity});
  log_a = between(1, 30);
  scale = between(1, 200);
  is_signed = any_bool();
  map = {between(0.5, 2), between(-2000, -1000), any_bool()};
}
inline void randomise(FitOptions& o) {
  auto& [weights, use_background, min_overlap] = o;
  weights.reset();
  if (any_bool()) weights = SimulationWeights{between(-2, 2), between(-2, 2), between(-9, 9)};
  use_background = any_bool();
  min_overlap = between(0, 1);
}

inline void randomise(Lc2Options& o) {
  auto& [channel, ridge, ridge_gradient, positive] = o;
  channel = one_of({GradientChannel::kMagnitude, GradientChannel::kAlongBeam});
  ridge = between(0, 99);
  ridge_gradient = between(0, 99);
  positive = any_bool();
}
inline void randomise(LocalLc2Options& o) {
  struct Same : Lc2Options {
    PatchOptions patches;
    PatchWeighting weighting;
    double pressed_mm, power;
  };
  static_assert(sizeof(LocalLc2Options) == sizeof(Same));
  randomise(static_cast<Lc2Options&>(o));
  randomise(o.patches);
  o.weighting =
      one_of({PatchWeighting::kCount, PatchWeighting::kDeviation, PatchWeighting::kVariance});
  o.pressed_mm = between(0, 200);
  o.power = between(0.25, 8);
}
inline void randomise(GlobalLc2Options& o) {
  static_assert(sizeof(GlobalLc2Options) == sizeof(Lc2Options) + sizeof(PatchOptions));
  randomise(static_cast<Lc2Options&>(o));
  randomise(o.patches);
}
inline void randomise(NccOptions& o) {
  auto& [patches] = o;
  randomise(patches);
}
template <typename Histogram>
void randomise_histogram(Histogram& o) {
  auto& [patches, bins] = o;
  randomise(patches);
  bins = any_int(8, 129);
}
inline void randomise(MattesMiOptions& o) { randomise_histogram(o); }
inline void randomise(NmiOptions& o) { randomise_histogram(o); }
inline void randomise(CorrelationRatioOptions& o) { randomise_histogram(o); }
inline void randomise(JointCorrelationRatioOptions& o) {
  auto& [patches, bins, gradient_bins, gradient_scale, prior_samples] = o;
  randomise(patches);
  bins = any_int(8, 129);
  gradient_bins = any_int(2, 33);
  gradient_scale = between(0.1, 100);
  prior_samples = between(0, 100);
}
inline void randomise(SimulatedLc2Options& o) {
  auto& [simulation, fit] = o;
  randomise(simulation);
  randomise(fit);
}
inline void randomise(SimilarityOptions& o) {
  const std::vector<std::string> names = similarity_names();
  o = similarity_named(*rc::gen::elementOf(names), "test");
  std::visit([](auto& metric) { randomise(metric); }, o);
}

inline void randomise(StartOptions& o) {
  auto& [region, count, rotation_rad, translation_mm] = o;
  region = one_of({StartRegion::kBox, StartRegion::kBall});
  count = any_int(1, 100000);
  rotation_rad = between(0, region == StartRegion::kBox ? 1.8 : 3.14);
  translation_mm = between(0, 100);
}
/// Files do not hold the seed: a registration passes its own on.
inline void randomise(OptimizerOptions& o) {
  auto& [method, seed, evaluations, step, tolerance, cost, population] = o;
  static_cast<void>(seed);
  method = one_of({OptimizerMethod::kCmaEs, OptimizerMethod::kBobyqa, OptimizerMethod::kNelderMead,
                   OptimizerMethod::kPraxis});
  evaluations = any_int(0, 100000);
  step = between(1, 10);
  tolerance = between(0.001, 0.9);
  cost = between(0, 1);
  population = any_bool() ? 0 : any_int(5, 100);
}
inline void randomise(ClimbOptions& o) {
  auto& [spacing, similarity, optimizer, reach] = o;
  spacing = maybe(0.1, 10);
  randomise(similarity);
  randomise(optimizer);
  reach = between(10, 100);
}
inline void randomise(LevelOptions& o) {
  static_assert(sizeof(LevelOptions) == sizeof(ClimbOptions) + 4 * sizeof(int));
  randomise(static_cast<ClimbOptions&>(o));
  o.optimised = any_int(1, 100);
  o.screened.reset();
  if (any_bool()) o.screened = any_int(o.optimised, 200);
  o.kept = any_int(1, o.optimised + 1);
}
inline void randomise(SearchOptions& o) {
  auto& [starts, levels, rounds, distinct_mm, most_optima, margin_mm, most_turn_rad] = o;
  starts.reset();
  if (any_bool()) randomise(starts.emplace());
  levels.resize(static_cast<std::size_t>(any_int(1, 5)));
  for (LevelOptions& level : levels) randomise(level);
  // From coarse to fine.
  std::vector<std::optional<double>> spacings;
  for (const LevelOptions& level : levels) spacings.push_back(level.spacing_mm);
  std::sort(spacings.rbegin(), spacings.rend());  // none is less than any
  for (std::size_t i = 0; i < levels.size(); ++i) levels[i].spacing_mm = spacings[i];
  rounds = any_int(1, 32);
  distinct_mm = between(0, 10);
  most_optima = any_int(1, 100);
  margin_mm = between(0, 30);
  most_turn_rad = between(0.1, 3);
}
inline void randomise(RefinementOptions& o) {
  static_assert(sizeof(RefinementOptions) == sizeof(ClimbOptions) + sizeof(double));
  randomise(static_cast<ClimbOptions&>(o));
  o.ct_margin_mm = between(0, 30);
}
inline void randomise(GateLimits& o) {
  auto& [overlap, wrong_probability] = o;
  overlap = maybe(0, 1);
  wrong_probability = maybe(0, 1);
}
inline void randomise(PartOptions& o) {
  auto& [optimizer, reach_mm] = o;
  randomise(optimizer);
  reach_mm = between(10, 100);
}
inline void randomise(ErrorOptions& o) {
  auto& [factor, sound_speed, sweep, lag, other_mm, bound, radius_mm] = o;
  factor = between(0.1, 9);
  sound_speed = between(0, 0.2);
  sweep = between(0, 0.2);
  lag = between(0, 3);
  other_mm = between(0, 3);
  bound = between(0.1, 9);
  radius_mm = between(1, 99);
}
inline void randomise(ConfidenceOptions& o) {
  auto& [gates, source, rival_mm, similarity, ridge_similarity, cluster_mm, step_mm, parts, error] =
      o;
  randomise(gates);
  source = one_of({EvidenceSource::kOwn, EvidenceSource::kOwnFirst, EvidenceSource::kPatient});
  rival_mm = between(1, 30);
  randomise(similarity);
  randomise(ridge_similarity);
  cluster_mm = between(1, 50);
  step_mm = between(0.1, 20);
  randomise(parts);
  randomise(error);
}
inline RegistrationOptions any_options() {
  RegistrationOptions options;
  auto& [beams, window, outside_hu, spacing, conditioning, search, refinement, confidence,
         correct_sweep, seed] = options;
  beams = one_of({BeamKind::kAny, BeamKind::kParallel});
  randomise(window);
  outside_hu = any_int(0, 2);
  spacing = maybe(0.1, 5);
  randomise(conditioning);
  randomise(search);
  refinement.reset();
  if (any_bool()) randomise(refinement.emplace());
  randomise(confidence);
  correct_sweep = any_bool();
  seed = *rc::gen::arbitrary<std::uint32_t>();
  // Evidence compares patches, and mirrors the images of the levels.
  bool has_evidence =
      needs_of(confidence.similarity).has_parts && needs_of(confidence.ridge_similarity).has_parts;
  for (const LevelOptions& level : search.levels)
    has_evidence &=
        confidence.evidence == EvidenceSource::kPatient || !needs_of(level.similarity).recorded_ct;
  if (!has_evidence) confidence.gates.max_wrong_probability.reset();
  return options;
}

}  // namespace usct::test
