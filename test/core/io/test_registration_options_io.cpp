#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <limits>

#include "core/io/bad_files.h"
#include "test_paths.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/options/registration_options_io.h"

namespace usct {
namespace {

using test::expect_input_error;
using test::slurp;
using test::spit;
using test::TemporaryFolder;
using namespace std::string_literals;

const std::filesystem::path kSourceFolder = USCT_SOURCE_DIR;

RegistrationOptions parse(const std::string& yaml) {
  return parse_registration_options(yaml, "options.yaml");
}

/// Expects the text to be refused with a message that names the file and every one of `named`.
void expect_refused(const std::string& yaml, std::vector<std::string> named) {
  SCOPED_TRACE(yaml);
  named.emplace_back("options.yaml: ");
  expect_input_error([&] { parse(yaml); }, named);
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("test text has no " + from);
  return text.replace(at, from.size(), to);
}

// Any options that are valid, and whether two are the same. Structured bindings hold every field:
// a new one does not compile until it is here, and so must come back from a file.

double between(double low, double high) {
  constexpr int kSteps = 1 << 30;
  return low + (high - low) * *rc::gen::inRange(0, kSteps + 1) / kSteps;
}
template <typename Enum>
Enum one_of(std::initializer_list<Enum> values) {
  return *rc::gen::elementOf(std::vector<Enum>(values));
}
bool any_bool() { return *rc::gen::arbitrary<bool>(); }
int any_int(int low, int high) { return *rc::gen::inRange(low, high); }

void randomise(HuWindow& o) {
  auto& [low_hu, high_hu] = o;
  low_hu = any_int(-1000, 0);
  high_hu = any_int(1, 3000);
}
void randomise(DepthOptions& o) {
  auto& [min_mm, max_mm, automatic, near_mm, near_limit_mm, share, margin_mm] = o;
  if (any_bool()) min_mm = between(0, 40);
  if (any_bool()) max_mm = between(41, 200);
  automatic = any_bool();
  near_mm = between(0, 20);
  near_limit_mm = between(0, 50);
  share = between(0.01, 2);
  margin_mm = between(0, 9);
}
void randomise(ConditioningOptions& o) {
  auto& [normalisation, smoothing, window, least, depth, saturated, contact, shadow, grey, length] =
      o;
  normalisation = one_of({Normalisation::kNone, Normalisation::kFlatten, Normalisation::kZScore});
  smoothing = between(0, 3);
  window = between(0.1, 20);
  least = between(0.01, 1);
  randomise(depth);
  saturated = any_bool() ? std::numeric_limits<double>::infinity() : between(1, 300);
  contact = between(0, 0.9);
  shadow = between(0, 0.9);
  grey = between(0, 255);
  length = between(0, 30);
}
void randomise(PatchOptions& o) {
  auto& [depth_mm, lateral_mm, elevation_mm, share, samples] = o;
  depth_mm = between(0.1, 50);
  lateral_mm = any_bool() ? std::numeric_limits<double>::infinity() : between(0.1, 50);
  elevation_mm = between(0.1, 50);
  share = between(0.01, 1);
  samples = one_of({SampleSubset::kAll, SampleSubset::kHalf});
}
void randomise(SimilarityOptions& o) {
  auto& [kind, channel, patches, weighting, pressed, ridge, ridge_gradient, positive, power, bins,
         gradient_bins, gradient_scale, scalar] = o;
  kind = one_of({SimilarityKind::kLocalLc2, SimilarityKind::kGlobalLc2, SimilarityKind::kNcc,
                 SimilarityKind::kMattesMi, SimilarityKind::kNmi, SimilarityKind::kCorrelationRatio,
                 SimilarityKind::kJointCorrelationRatio, SimilarityKind::kSimulatedLc2});
  channel = one_of({GradientChannel::kMagnitude, GradientChannel::kAlongBeam});
  randomise(patches);
  weighting =
      one_of({PatchWeighting::kCount, PatchWeighting::kDeviation, PatchWeighting::kVariance});
  pressed = between(0, 200);
  ridge = between(0, 99);
  ridge_gradient = between(0, 99);
  positive = any_bool();
  power = between(0.25, 8);
  bins = any_int(8, 129);
  gradient_bins = any_int(2, 33);
  gradient_scale = between(0.1, 100);
  scalar = any_bool();
}
void randomise(StartOptions& o) {
  auto& [region, count, rotation_rad, translation_mm] = o;
  region = one_of({StartRegion::kBox, StartRegion::kBall});
  count = any_int(1, 100000);
  rotation_rad = between(0, region == StartRegion::kBox ? 1.8 : 3.14);
  translation_mm = between(0, 100);
}
/// The seed is not in files: a registration passes its own on.
void randomise(OptimizerOptions& o) {
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
void randomise(SimulationOptions& o) {
  auto& [interpolation, outside, window, shift, floor, length, transmission, occlusion, compression,
         log_a, scale, is_signed, map] = o;
  interpolation = one_of({Interpolation::kNearest, Interpolation::kTrilinear});
  outside = between(-100, 100);
  if (any_bool()) randomise(window.emplace());
  shift = between(900, 1100);
  floor = between(1, 100);
  length = between(0.1, 3);
  if (any_bool()) transmission = between(0.1, 3);
  occlusion.by_threshold = any_bool();
  occlusion.bone_hu = between(300, 900);
  occlusion.gas_hu = between(-900, -300);
  occlusion.gradient_hu_per_mm =
      any_bool() ? std::numeric_limits<double>::infinity() : between(100, 900);
  compression = one_of({LogCompression::kReflection, LogCompression::kIntensity});
  log_a = between(1, 30);
  scale = between(1, 200);
  is_signed = any_bool();
  map = {between(0.5, 2), between(-2000, -1000), any_bool()};
}
void randomise(FitOptions& o) {
  auto& [weights, use_background, min_overlap] = o;
  if (any_bool()) weights = SimulationWeights{between(-2, 2), between(-2, 2), between(-9, 9)};
  use_background = any_bool();
  min_overlap = between(0, 1);
}
void randomise(ConfidenceOptions& o) {
  auto& [min_overlap, background, background_mm, significance, margin, disagreement, displacement,
         confirmation, scatter, factor, systematic] = o;
  min_overlap = between(0, 1);
  background = any_int(16, 500);
  background_mm = between(1, 50);
  significance = between(-9, 99);
  margin = between(0, 1);
  disagreement = between(0, 9);
  displacement = any_bool() ? std::numeric_limits<double>::infinity() : between(1, 99);
  randomise(confirmation);
  scatter = between(0, 9);
  factor = between(0.1, 9);
  systematic = between(0, 3);
}
void randomise(StageOptions& o) {
  auto& [spacing, similarity, starts, optimised, kept, optimizer, reach, depth, sweep] = o;
  // Only the first stage may have starts, only the last may estimate errors.
  static_cast<void>(starts);
  static_cast<void>(depth);
  static_cast<void>(sweep);
  spacing = between(0.1, 10);
  randomise(similarity);
  optimised = any_int(1, 100);
  kept = any_int(1, optimised + 1);
  randomise(optimizer);
  reach = between(10, 100);
}
RegistrationOptions any_options() {
  RegistrationOptions options;
  auto& [window, outside_hu, spacing, conditioning, simulation, fit, stages, rounds, distinct_mm,
         confidence, seed] = options;
  randomise(window);
  outside_hu = any_int(0, 2);
  spacing = between(0.1, 5);
  randomise(conditioning);
  stages.resize(static_cast<std::size_t>(any_int(1, 5)));
  for (StageOptions& stage : stages) randomise(stage);
  if (any_bool()) randomise(stages.front().starts.emplace());
  stages.back().depth_error = between(0, 0.1);
  stages.back().sweep_error = between(0, 0.1);
  randomise(simulation);
  randomise(fit);
  rounds = any_int(1, 7);
  randomise(confidence);
  distinct_mm = between(0, 10);
  seed = *rc::gen::arbitrary<std::uint32_t>();
  return options;
}

bool same(const HuWindow& a, const HuWindow& b) {
  return a.low_hu == b.low_hu && a.high_hu == b.high_hu;
}
bool same(const DepthOptions& a, const DepthOptions& b) {
  return a.min_mm == b.min_mm && a.max_mm == b.max_mm && a.automatic == b.automatic &&
         a.near_field_mm == b.near_field_mm && a.near_field_limit_mm == b.near_field_limit_mm &&
         a.far_wall_share == b.far_wall_share && a.far_wall_margin_mm == b.far_wall_margin_mm;
}
bool same(const ConditioningOptions& a, const ConditioningOptions& b) {
  return a.normalisation == b.normalisation && a.smoothing_mm == b.smoothing_mm &&
         a.window_mm == b.window_mm && a.least_deviation == b.least_deviation &&
         same(a.depth, b.depth) && a.saturated_grey == b.saturated_grey &&
         a.no_contact_share == b.no_contact_share && a.shadow_share == b.shadow_share &&
         a.visible_grey == b.visible_grey && a.min_shadow_mm == b.min_shadow_mm;
}
bool same(const PatchOptions& a, const PatchOptions& b) {
  return a.depth_mm == b.depth_mm && a.lateral_mm == b.lateral_mm &&
         a.elevation_mm == b.elevation_mm && a.least_share == b.least_share &&
         a.samples == b.samples;
}
bool same(const SimilarityOptions& a, const SimilarityOptions& b) {
  return a.kind == b.kind && a.channel == b.channel && same(a.patches, b.patches) &&
         a.weighting == b.weighting && a.pressed_mm == b.pressed_mm &&
         a.ridge_intensity_hu == b.ridge_intensity_hu &&
         a.ridge_gradient_hu_per_mm == b.ridge_gradient_hu_per_mm &&
         a.positive_gradient == b.positive_gradient && a.power == b.power && a.bins == b.bins &&
         a.gradient_bins == b.gradient_bins &&
         a.gradient_scale_hu_per_mm == b.gradient_scale_hu_per_mm && a.scalar == b.scalar;
}
bool same(const StartOptions& a, const StartOptions& b) {
  return a.region == b.region && a.count == b.count &&
         std::abs(a.rotation_rad - b.rotation_rad) <= 1e-15 * a.rotation_rad &&
         a.translation_mm == b.translation_mm;
}
bool same(const OptimizerOptions& a, const OptimizerOptions& b) {
  return a.method == b.method && a.max_evaluations == b.max_evaluations &&
         a.initial_step == b.initial_step && a.step_tolerance == b.step_tolerance &&
         a.cost_tolerance == b.cost_tolerance && a.population == b.population;
}
bool same(const StageOptions& a, const StageOptions& b) {
  return a.spacing_mm == b.spacing_mm && same(a.similarity, b.similarity) &&
         a.starts.has_value() == b.starts.has_value() &&
         (!a.starts || same(*a.starts, *b.starts)) && a.optimised == b.optimised &&
         a.kept == b.kept && same(a.optimizer, b.optimizer) && a.reach_mm == b.reach_mm &&
         a.depth_error == b.depth_error && a.sweep_error == b.sweep_error;
}
bool same(const SimulationOptions& a, const SimulationOptions& b) {
  return a.interpolation == b.interpolation && a.outside_hu == b.outside_hu &&
         a.window.has_value() == b.window.has_value() &&
         (!a.window || same(*a.window, *b.window)) && a.hu_shift == b.hu_shift &&
         a.mu_floor == b.mu_floor && a.gradient_length_mm == b.gradient_length_mm &&
         a.transmission_length_mm == b.transmission_length_mm &&
         a.occlusion.by_threshold == b.occlusion.by_threshold &&
         a.occlusion.bone_hu == b.occlusion.bone_hu && a.occlusion.gas_hu == b.occlusion.gas_hu &&
         a.occlusion.gradient_hu_per_mm == b.occlusion.gradient_hu_per_mm &&
         a.log_compression == b.log_compression && a.log_a == b.log_a &&
         a.reflection_scale == b.reflection_scale && a.signed_reflection == b.signed_reflection &&
         a.map.slope == b.map.slope && a.map.offset == b.map.offset && a.map.clamp == b.map.clamp;
}
bool same(const FitOptions& a, const FitOptions& b) {
  return a.fixed_weights.has_value() == b.fixed_weights.has_value() &&
         (!a.fixed_weights || (a.fixed_weights->mapped_ct == b.fixed_weights->mapped_ct &&
                               a.fixed_weights->reflection == b.fixed_weights->reflection &&
                               a.fixed_weights->bias == b.fixed_weights->bias)) &&
         a.use_background == b.use_background && a.min_overlap == b.min_overlap;
}
bool same(const ConfidenceOptions& a, const ConfidenceOptions& b) {
  return a.min_overlap == b.min_overlap && a.background == b.background &&
         a.background_mm == b.background_mm && a.min_significance == b.min_significance &&
         a.min_margin == b.min_margin && a.max_disagreement_mm == b.max_disagreement_mm &&
         a.max_displacement_mm == b.max_displacement_mm && same(a.confirmation, b.confirmation) &&
         a.max_scatter_mm == b.max_scatter_mm && a.deviation_factor == b.deviation_factor &&
         a.systematic_mm == b.systematic_mm;
}
bool same(const RegistrationOptions& a, const RegistrationOptions& b) {
  return same(a.window, b.window) && a.outside_hu == b.outside_hu &&
         a.conditioning_spacing_mm == b.conditioning_spacing_mm &&
         same(a.conditioning, b.conditioning) && a.stages.size() == b.stages.size() &&
         std::equal(a.stages.begin(), a.stages.end(), b.stages.begin(),
                    [](const StageOptions& x, const StageOptions& y) { return same(x, y); }) &&
         same(a.simulation, b.simulation) && same(a.fit, b.fit) && a.rounds == b.rounds &&
         same(a.confidence, b.confidence) && a.distinct_mm == b.distinct_mm && a.seed == b.seed;
}

RC_GTEST_PROP(RegistrationOptionsIo, EveryFieldComesBackFromAFile, ()) {
  const RegistrationOptions options = any_options();
  const TemporaryFolder folder;
  const RegistrationOptions back = read_registration_options(
      spit(folder.path() / "options.yaml", registration_options_yaml(options)));
  RC_ASSERT(same(options, back));
}

RC_GTEST_PROP(RegistrationOptionsIo, TheListHoldsEveryScalarOfTheText, ()) {
  const RegistrationOptions options = any_options();
  const std::string yaml = registration_options_yaml(options);
  std::size_t scalars = 0;
  for (std::size_t at = yaml.find(": "); at != std::string::npos; at = yaml.find(": ", at + 1))
    ++scalars;
  RC_ASSERT(registration_options_text(options).size() == scalars);
}

TEST(RegistrationOptionsIo, TheListNamesWholePaths) {
  const auto list = registration_options_text(preset("patient"));
  EXPECT_EQ(list.at("stages[0].starts.rotation_deg").substr(0, 2), "25");
  EXPECT_EQ(list.at("stages[1].starts"), "none");
  EXPECT_EQ(list.at("stages[2].optimizer.method"), "bobyqa");
  EXPECT_EQ(list.at("conditioning.depth.automatic"), "true");
}

TEST(Presets, EachIsItsFileAndLoads) {
  std::vector<std::string> files;
  for (const auto& entry :
       std::filesystem::directory_iterator(kSourceFolder / "config" / "presets")) {
    const std::string name = entry.path().stem();
    SCOPED_TRACE(name);
    files.push_back(name);
    const auto bytes = slurp(entry.path());
    EXPECT_EQ(preset_yaml(name), std::string(bytes.begin(), bytes.end()));
    EXPECT_TRUE(same(preset(name), read_registration_options(entry.path())));
    EXPECT_EQ(preset_yaml(name).substr(0, 2), "# ") << "says first what it is for";
  }
  std::sort(files.begin(), files.end());
  EXPECT_EQ(files, preset_names());
  EXPECT_GE(files.size(), 6U);
}

TEST(Presets, OfOtherNamesAreRefused) {
  expect_input_error([] { preset("patiant"); }, {"patiant", "fast", "patient", "thesis_b"});
  expect_refused("preset: patiant\n", {"'preset'", "patiant", "thesis_b"});
  expect_refused("preset: [patient]\n", {"'preset'"});
}

TEST(Presets, AFileChangesOnlyWhatItHolds) {
  RegistrationOptions expected = preset("patient");
  EXPECT_TRUE(same(parse("preset: patient\n"), expected));
  expected.window.high_hu = 300;
  expected.conditioning.depth.max_mm = 90.5;
  expected.seed = 4294967295U;
  EXPECT_TRUE(same(parse("preset: patient\nwindow:\n  high_hu: 300\nseed: 4294967295\n"
                         "conditioning: {depth: {max_mm: 90.5}}\n"),
                   expected));
}

TEST(Presets, StagesAreChangedByNumberLeftOutOrReplaced) {
  RegistrationOptions expected = preset("patient");
  ASSERT_EQ(expected.stages.size(), 3U);
  expected.stages[1].optimizer.initial_step = 1.5;
  expected.stages[0].starts->rotation_rad = 10.0 * kDegree;
  EXPECT_TRUE(same(parse("preset: patient\nstages:\n  1: {optimizer: {initial_step: 1.5}}\n"
                         "  0: {starts: {rotation_deg: 10}}\n"),
                   expected));
  expected = preset("patient");
  expected.stages.erase(expected.stages.begin() + 1);
  expected.stages[0].starts.reset();
  EXPECT_TRUE(same(parse("preset: patient\nstages: {1: none, 0: {starts: none}}\n"), expected));
  expected = preset("fast");
  expected.stages = {preset("patient").stages[1]};
  const std::string all = registration_options_yaml(expected);
  const std::string stages =
      all.substr(all.find("stages:"), all.find("rounds") - all.find("stages:"));
  EXPECT_TRUE(same(parse("preset: fast\n" + stages), expected));
}

TEST(RegistrationOptionsIo, AFileWithoutAPresetMustBeComplete) {
  const std::string whole = registration_options_yaml(preset("patient"));
  EXPECT_NO_THROW(parse(whole));
  const std::string hint = "only a file with 'preset: NAME' may leave keys out";
  expect_refused(replaced(whole, "  high_hu: 400\n", ""), {"'window.high_hu' is missing", hint});
  expect_refused(replaced(whole, "      power: 1\n", ""), {"'stages[0].similarity.power'", hint});
  expect_refused(replaced(whole, "  - spacing_mm: 2\n    similarity:", "  - similarity:"),
                 {"'stages[1].spacing_mm' is missing", hint});
  // A list of stages is of whole ones, whatever else the file derives from; so are starts where
  // there were none.
  expect_refused("preset: patient\nstages: [{spacing_mm: 2}]\n", {"'stages[0].similarity'"});
  expect_refused("preset: patient\nstages: {1: {starts: {count: 8}}}\n",
                 {"'stages[1].starts.region'"});
}

TEST(RegistrationOptionsIo, UnknownAndRepeatedKeysAreNamedWithTheirPath) {
  const auto derived = [](const std::string& rest) { return "preset: patient\n" + rest; };
  expect_refused(derived("sed: 4\n"), {"'sed' is unknown"});
  expect_refused(derived("conditioning: {depth: {min: 4}}\n"),
                 {"'conditioning.depth.min' is unknown"});
  expect_refused(derived("stages: {2: {optimizer: {seed: 4}}}\n"),
                 {"'stages[2].optimizer.seed' is unknown"});
  expect_refused(derived("seed: 4\nseed: 4\n"), {"'seed' is given twice"});
  expect_refused(derived("stages: {1: {kept: 1, kept: 2}}\n"), {"'stages[1].kept' is given twice"});
  expect_refused(derived("stages: {3: {kept: 1}}\n"), {"'stages'", "'3'", "within [0, 2]"});
  expect_refused(derived("stages: {fine: {kept: 1}}\n"), {"'stages'", "fine"});
}

TEST(RegistrationOptionsIo, WrongTypesAreNamedWithTheirPath) {
  const auto stage = [](const std::string& rest) {
    return "preset: patient\nstages: {1: {" + rest + "}}\n";
  };
  expect_refused(stage("kept: two"), {"'stages[1].kept'", "two", "whole number"});
  expect_refused(stage("kept: 1.5"), {"'stages[1].kept'", "1.5"});
  expect_refused(stage("spacing_mm: [1]"), {"'stages[1].spacing_mm'", "single value"});
  expect_refused(stage("spacing_mm: .nan"), {"'stages[1].spacing_mm'", ".nan"});
  expect_refused(stage("similarity: local_lc2"), {"'stages[1].similarity'"});
  expect_refused(stage("similarity: {kind: lc3}"),
                 {"'stages[1].similarity.kind' is 'lc3'", "local_lc2", "mattes_mi"});
  expect_refused(stage("similarity: {weighting: most}"),
                 {"'stages[1].similarity.weighting' is 'most'", "deviation"});
  expect_refused(stage("similarity: {scalar: 1}"), {"'stages[1].similarity.scalar'", "true"});
  expect_refused(stage("optimizer: {method: newton}"),
                 {"'stages[1].optimizer.method' is 'newton'", "bobyqa"});
  for (const char* seed : {"-1", "4294967296", "0.5", "x"})
    expect_refused("preset: patient\nseed: " + std::string(seed) + "\n", {"'seed'", seed});
  expect_refused("preset: patient\nstages: 3\n", {"'stages' must be a list"});
  expect_refused("- preset\n", {"key: value"});
  expect_refused("window: {\n", {"not valid YAML"});
}

TEST(RegistrationOptionsIo, ValuesOutOfRangeAreNamedWithTheirPath) {
  const auto stage = [](const std::string& rest) {
    return "preset: patient\nstages: {0: {" + rest + "}}\n";
  };
  expect_refused(stage("optimizer: {initial_step: -3}"),
                 {"'stages[0].optimizer.initial_step' is -3", "> 0"});
  expect_refused(stage("optimizer: {initial_step: 0.1}"), {"'stages[0].optimizer.step_tolerance'"});
  expect_refused(stage("similarity: {bins: 7}"), {"'stages[0].similarity.bins' is 7", "[8, 128]"});
  expect_refused(stage("similarity: {patches: {samples: some}}"),
                 {"'stages[0].similarity.patches.samples' is 'some'", "all, half"});
  expect_refused(stage("similarity: {patches: {least_share: 0}}"),
                 {"'stages[0].similarity.patches.least_share' is 0"});
  expect_refused(stage("starts: {count: 0}"), {"'stages[0].starts.count' is 0", ">= 1"});
  expect_refused(stage("starts: {rotation_deg: 104}"),
                 {"'stages[0].starts.rotation_deg' is 104", "[0, 103.92]"});
  expect_refused(stage("starts: {rotation_deg: -1}"), {"'stages[0].starts.rotation_deg' is -1"});
  EXPECT_NO_THROW(parse(stage("starts: {rotation_deg: 180, region: ball}")));
  expect_refused("preset: patient\nwindow: {low_hu: 401}\n", {"'window.low_hu' is 401"});
  expect_refused("preset: patient\nconditioning: {depth: {near_field_mm: -1}}\n",
                 {"'conditioning.depth.near_field_mm' is -1"});
  expect_refused("preset: patient\nstages: []\n", {"stages"});
  expect_refused("preset: patient\nstages: {0: none, 1: none, 2: none}\n", {"stages"});
}

TEST(RegistrationOptionsIo, FilesThatCannotBeReadAreNamed) {
  const TemporaryFolder folder;
  expect_input_error([&] { read_registration_options(folder.path() / "absent.yaml"); },
                     {"absent.yaml", "does not exist"});
  expect_input_error([&] { read_registration_options(spit(folder.path() / "o.yaml", "a: {"s)); },
                     {"o.yaml", "not valid YAML"});
}

TEST(RegistrationOptionsIo, EveryKeyIsDocumented) {
  const auto bytes = slurp(kSourceFolder / "docs" / "registration_options.md");
  const std::string docs(bytes.begin(), bytes.end());
  for (const auto& [path, value] : registration_options_text(preset("patient"))) {
    std::string key = path;
    if (key.rfind("stages[", 0) == 0) key = key.substr(key.find('.') + 1);
    // A similarity like those of the stages.
    if (key.rfind("confidence.confirmation.", 0) == 0)
      key = "similarity." + key.substr(std::string("confidence.confirmation.").size());
    EXPECT_NE(docs.find("`" + key + "`"), std::string::npos) << key;
  }
}

}  // namespace
}  // namespace usct
