#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "core/io/expect_input_error.h"
#include "core/registration/registration_cases.h"
#include "nan.h"

namespace usct::test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

void expect_refused(const RegistrationResult& result, RegistrationStatus status,
                    const std::string& named) {
  EXPECT_EQ(result.status, status) << result.message;
  EXPECT_FALSE(result.T_us_ct);
  EXPECT_NE(result.message.find(named), std::string::npos) << result.message;
}

RegistrationCase with_brightness(const RegistrationCase& images, float value) {
  RegistrationCase result = images;
  std::fill(result.us.brightness.begin(), result.us.brightness.end(), value);
  return result;
}

TEST(Refusals, CtFarAway) {
  for (const double distance_mm : {400.0, 1e6}) {
    const Isometry3d initial =
        Eigen::Translation3d(0.0, distance_mm, 0.0) * agar_case().T_us_ct_true;
    expect_refused(registered(agar_case(), initial), RegistrationStatus::kNoOverlap, "near");
  }
}

TEST(Refusals, CtThatBarelyTouches) {
  RegistrationOptions options = quick_options();
  options.search.starts->translation_mm = 1.0;
  const Isometry3d initial = Eigen::Translation3d(0.0, 0.0, 125.0) * agar_case().T_us_ct_true;
  const RegistrationResult result = registered(agar_case(), initial, options);
  EXPECT_NE(result.status, RegistrationStatus::kRegistered) << result.message;
  EXPECT_FALSE(result.T_us_ct);
}

TEST(Refusals, ConstantUltrasound) {
  for (const float value : {0.0F, 80.0F, 255.0F})
    expect_refused(registered(with_brightness(agar_case(), value), nearby(agar_case())),
                   RegistrationStatus::kFailed, "ultrasound");
}

TEST(Refusals, UnknownUltrasound) {
  RegistrationCase images = agar_case();
  images.us.known.assign(images.us.brightness.size(), 0);
  expect_refused(registered(images, nearby(images)), RegistrationStatus::kFailed, "ultrasound");
}

/// A volume of 8 bits that is one line of voxels.
TEST(Refusals, UltrasoundOnOneLine) {
  RegistrationCase images = agar_case();
  BeamGrid& beams = images.us.beams;
  beams.axial.samples *= 4;  // so that enough of them count
  beams.beams = {beams.beams[beams.beams.size() / 2]};
  beams.lines = beams.frames = 1;
  images.us.known.clear();
  std::mt19937 random(1);
  images.us.brightness.resize(static_cast<std::size_t>(beams.samples()));
  for (float& value : images.us.brightness) value = static_cast<float>(random() % 200);
  expect_refused(registered(images, nearby(images)), RegistrationStatus::kFailed, "on one line");
}

/// A single frame has no first and no last half.
TEST(Refusals, UltrasoundOfOneFrame) {
  RegistrationCase images = agar_case();
  BeamGrid& beams = images.us.beams;
  const auto lines = static_cast<std::size_t>(beams.lines);
  const auto first =
      static_cast<std::ptrdiff_t>(lines * static_cast<std::size_t>(beams.frames / 2));
  beams.beams = {beams.beams.begin() + first,
                 beams.beams.begin() + first + static_cast<std::ptrdiff_t>(lines)};
  const auto samples = static_cast<std::ptrdiff_t>(beams.samples());
  images.us.brightness = {
      images.us.brightness.begin() + first * samples,
      images.us.brightness.begin() + (first + static_cast<std::ptrdiff_t>(lines)) * samples};
  images.us.known.clear();
  beams.frames = 1;
  expect_refused(registered(images, nearby(images)), RegistrationStatus::kFailed,
                 "one frame in another place than the others");
}

/// Slices that are too few for any level, though they lie in the middle of the field.
TEST(Refusals, CtOfThreeSlices) {
  RegistrationCase images = agar_case();
  Region slices{{0, 0, images.ct.grid.size.z() / 2}, images.ct.grid.size};
  slices.size.z() = 3;
  images.ct = crop(images.ct, slices);
  expect_refused(registered(images, nearby(images)), RegistrationStatus::kNoOverlap,
                 "x 3 voxels lie in reach");
}

TEST(Refusals, Noise) {
  for (const std::uint32_t seed : {1U, 2U, 3U}) {
    RegistrationCase images = agar_case();
    std::mt19937 random(seed);
    for (float& value : images.us.brightness) value = static_cast<float>(random() % 256);
    const RegistrationResult result = registered(images, nearby(images));
    expect_refused(result, RegistrationStatus::kLowConfidence, "must be");
    EXPECT_FALSE(result.candidates.empty());
  }
}

/// Matched blocks climb by the similarity of the evidence, which may have no derivatives.
TEST(Refusals, NoiseByASimilarityWithoutDerivatives) {
  RegistrationCase images = agar_case();
  std::mt19937 random(4);
  for (float& value : images.us.brightness) value = static_cast<float>(random() % 256);
  const RegistrationOptions options = parse_registration_options(
      "preset: patient\nsearch: {rounds: 2}\nconfidence: {similarity: {channel: along_beam}, "
      "ridge_similarity: {channel: along_beam}, parts: {optimizer: {method: bobyqa}}}\n",
      "test");
  expect_refused(registered(images, nearby(images), options), RegistrationStatus::kLowConfidence,
                 "must be");
}

/// Takes the image of each beam from another beam, or upside down.
template <typename SampleOf>
RegistrationCase reordered(const RegistrationCase& images, const SampleOf& sample_of) {
  RegistrationCase result = images;
  const BeamGrid& beams = images.us.beams;
  const auto at = [&](int f, int l, int s) {
    return static_cast<std::size_t>((f * beams.lines + l) * beams.samples() + s);
  };
  for (int f = 0; f < beams.frames; ++f)
    for (int l = 0; l < beams.lines; ++l)
      for (int s = 0; s < beams.samples(); ++s) {
        const Eigen::Vector3i from = sample_of(f, l, s);
        result.us.brightness[at(f, l, s)] = images.us.brightness[at(from[0], from[1], from[2])];
      }
  return result;
}

/// Kidneys are nearly symmetric, as is a block of agar: a mirror image is the most similar wrong
/// one. The ultrasound as it should be is then among the decoys, and tells what is wrong.
TEST(Refusals, MirroredUltrasoundIsNamed) {
  for (const RegistrationCase* images : {&agar_case(), &patient_case()}) {
    const int lines = images->us.beams.lines, frames = images->us.beams.frames;
    const RegistrationCase across_lines = reordered(
        *images, [&](int f, int l, int s) { return Eigen::Vector3i(f, lines - 1 - l, s); });
    const RegistrationCase across_frames = reordered(
        *images, [&](int f, int l, int s) { return Eigen::Vector3i(frames - 1 - f, l, s); });
    for (const double sign : {1.0, -1.0}) {
      expect_refused(registered(across_lines, nearby(across_lines, sign), preset("patient")),
                     RegistrationStatus::kLowConfidence, "better with its lines in reverse order");
      expect_refused(registered(across_frames, nearby(across_frames, sign), preset("patient")),
                     RegistrationStatus::kLowConfidence, "better with its frames in reverse order");
    }
  }
}

RegistrationOptions with_limit(double max_wrong_probability) {
  RegistrationOptions options = preset("patient");
  options.confidence.gates.max_wrong_probability = max_wrong_probability;
  return options;
}

/// The second and third axes of a CT exchanged, the kidney in place. A limit that all other
/// evidence passes leaves the decision to what the CT looks like with its axes in the right order.
TEST(Refusals, ACtWithExchangedAxesIsNamed) {
  RegistrationCase images = agar_case();
  const Eigen::Vector3d kidney_ct_mm = images.T_us_ct_true.inverse() * middle_us_mm(images);
  auto& grid = images.ct.grid;
  const Eigen::Matrix3d before = grid.direction;
  grid.direction.col(1).swap(grid.direction.col(2));
  grid.origin_mm =
      kidney_ct_mm + grid.direction * before.transpose() * (grid.origin_mm - kidney_ct_mm);
  expect_refused(registered(images, nearby(images), with_limit(1.0 - 1e-9)),
                 RegistrationStatus::kLowConfidence,
                 "better with the second and third axes of the CT exchanged");
}

/// Below a tenth of the limit nothing is compared with exchanged axes. This limit is so low that
/// the right pose is compared with them, and it is accepted.
TEST(Refusals, ARightPoseIsBetterThanAnyWithExchangedAxes) {
  constexpr double kLimit = 0.1;
  const RegistrationResult result =
      registered(agar_case(), nearby(agar_case()), with_limit(kLimit));
  EXPECT_EQ(result.status, RegistrationStatus::kRegistered) << result.message;
  EXPECT_GT(result.measures.wrong_probability.value_or(0.0), 0.1 * kLimit);
}

/// The CT of another case, its kidney where that of the right CT is.
RegistrationCase with_ct_of(const RegistrationCase& other, RegistrationCase images) {
  const auto kidney_ct_mm = [](const RegistrationCase& its) -> Vector3d {
    return its.T_us_ct_true.inverse() * middle_us_mm(its);
  };
  images.ct =
      moved(other.ct, Isometry3d(Eigen::Translation3d(kidney_ct_mm(images) - kidney_ct_mm(other))));
  return images;
}

TEST(Refusals, AnotherAnatomy) {
  const RegistrationCase agar = with_ct_of(patient_case(), agar_case());
  const RegistrationCase patient = with_ct_of(agar_case(), patient_case());
  for (const RegistrationCase* images : {&agar, &patient})
    expect_refused(registered(*images, nearby(*images)), RegistrationStatus::kLowConfidence,
                   "wrong_probability is ");
}

TEST(Refusals, InitialPoseThatIsNotFinite) {
  for (const double value : {kNan, std::numeric_limits<double>::infinity()}) {
    Isometry3d initial = nearby(agar_case());
    initial.translation().y() = value;
    expect_refused(registered(agar_case(), initial), RegistrationStatus::kFailed, "initial pose");
  }
}

/// The climbs that look for errors of the acquisition begin with steps of 4, which are less.
TEST(Refusals, NoneForPartsThatClimbByWideSteps) {
  const RegistrationOptions options =
      quick_options("confidence: {parts: {optimizer: {initial_step: 10, step_tolerance: 4.5}}}\n");
  EXPECT_NO_THROW(registered(agar_case(), nearby(agar_case()), options));
}

TEST(Refusals, NoEvaluationAllowed) {
  const std::string none = "{optimizer: {max_evaluations: 0}}";
  const std::map<std::string, std::string> examples = {
      {"search.levels[0]", "search: {levels: {0: " + none + "}}\n"},
      {"search.levels[1]", "search: {levels: {1: " + none + "}}\n"},
      {"refinement", "refinement: " + none + "\n"}};
  for (const auto& [climb, changes] : examples) {
    const RegistrationResult result =
        registered(agar_case(), nearby(agar_case()), quick_options(changes));
    expect_refused(result, RegistrationStatus::kFailed, climb + ".optimizer.max_evaluations");
    EXPECT_TRUE(std::isnan(result.similarity));
    EXPECT_TRUE(result.candidates.empty());
  }
}

TEST(Refusals, InvalidCt) {
  RegistrationCase images = agar_case();
  images.ct.voxels.pop_back();
  expect_input_error([&] { registered(images, nearby(images)); }, {"CT", "voxels"});
  images.ct = {};
  expect_input_error([&] { registered(images, nearby(images)); }, {"CT", "size"});
  images.ct = agar_case().ct;
  images.ct.grid.spacing_mm.z() = 0.0;
  expect_input_error([&] { registered(images, nearby(images)); }, {"CT", "spacing"});
  images.ct = agar_case().ct;
  images.ct.grid.direction(0, 1) = 0.3;
  expect_input_error([&] { registered(images, nearby(images)); }, {"CT", "direction"});
}

TEST(Refusals, InvalidUltrasound) {
  const auto expect_error = [](const auto& change, const std::vector<std::string>& named) {
    RegistrationCase images = agar_case();
    change(images.us);
    expect_input_error([&] { registered(images, nearby(images)); }, named);
  };
  expect_error([](BeamUltrasound& us) { us = {}; }, {"ultrasound", "samples"});
  expect_error([](BeamUltrasound& us) { us.brightness.pop_back(); }, {"ultrasound", "brightness"});
  expect_error([](BeamUltrasound& us) { us.brightness[77] = kNan; }, {"ultrasound", "finite"});
  expect_error([](BeamUltrasound& us) { us.known.assign(3, 1); }, {"ultrasound", "known"});
  expect_error([](BeamUltrasound& us) { us.beams.axial.spacing_mm = -1.0; }, {"spacing_mm"});
  expect_error([](BeamUltrasound& us) { ++us.beams.frames; }, {"beam grid", "beams"});
  expect_error([](BeamUltrasound& us) { us.beams.lines = 0; }, {"beam grid", "lines"});
  expect_error([](BeamUltrasound& us) { us.beams.axial.start_depth_mm = kNan; },
               {"beam grid", "start_depth_mm"});
  expect_error([](BeamUltrasound& us) { us.beams.beams[9].origin_mm.x() = kNan; },
               {"beam grid", "beam 9"});
  expect_error([](BeamUltrasound& us) { us.beams.beams[9].direction *= 1.5; },
               {"beam grid", "beam 9"});
}

TEST(Refusals, InitialPoseThatIsNotRigid) {
  Isometry3d initial = nearby(agar_case());
  initial.linear() *= 1.01;
  expect_input_error([&] { registered(agar_case(), initial); }, {"T_us_ct_initial"});
  initial = nearby(agar_case());
  initial.linear().col(0) *= -1.0;
  expect_input_error([&] { registered(agar_case(), initial); }, {"T_us_ct_initial"});
}

TEST(Refusals, InvalidOptions) {
  const auto expect_error = [](const auto& change, const std::vector<std::string>& named) {
    RegistrationOptions options = quick_options();
    change(options);
    expect_input_error([&] { registered(agar_case(), nearby(agar_case()), options); }, named);
  };
  expect_error([](RegistrationOptions& o) { o.search.levels.clear(); }, {"search", "levels"});
  expect_error([](RegistrationOptions& o) { o.search.rounds = 0; }, {"search", "'rounds' is 0"});
  expect_error([](RegistrationOptions& o) { o.outside_hu = 1e5; }, {"'outside_hu' is 100000"});
  expect_error([](RegistrationOptions& o) { o.search.levels[1].spacing_mm = kNan; },
               {"search.levels[1]", "'spacing_mm'"});
  expect_error([](RegistrationOptions& o) { o.refinement->optimizer.initial_step = 0.0; },
               {"refinement.optimizer", "'initial_step' is 0"});
  expect_error(
      [](RegistrationOptions& o) {
        std::get<LocalLc2Options>(o.refinement->similarity).power = 0.0;
      },
      {"refinement.similarity", "'power' is 0"});
  expect_error([](RegistrationOptions& o) { o.confidence.gates.max_wrong_probability = 2.0; },
               {"confidence.gates", "'max_wrong_probability' is 2"});
  expect_error([](RegistrationOptions& o) { o.confidence.gates.min_overlap = kNan; },
               {"confidence.gates", "'min_overlap' is nan"});
}

/// A wrong pose had made the lattice of the matched blocks larger than memory, or than an int.
TEST(Refusals, ATrackedSweepThatJumpsIsNamed) {
  for (const double off_mm : {1e3, 1e5}) {
    RegistrationCase images = patient_case();
    BeamGrid& beams = images.us.beams;
    for (int beam = 0; beam < 5 * beams.lines; ++beam)
      beams.beams[static_cast<std::size_t>(beam)].origin_mm.x() += off_mm;
    expect_input_error([&] { registered(images, nearby(images)); },
                       {"ultrasound: frames 4 and 5 lie", "at most 200 mm", "pose"});
  }
}

TEST(Refusals, InvalidOptionsOfTheEvidence) {
  const auto expect_error = [](const auto& change, const std::vector<std::string>& named) {
    RegistrationOptions options = quick_options();
    change(options.confidence);
    expect_input_error([&] { options.validate("o"); }, named);
  };
  using Confidence = ConfidenceOptions;
  expect_error([](Confidence& o) { o.rival_mm = 0.9; },
               {"o.confidence", "'rival_mm' is 0.9", ">= 1"});
  expect_error([](Confidence& o) { o.cluster_mm = 0.0; }, {"o.confidence", "'cluster_mm' is 0"});
  expect_error([](Confidence& o) { o.cluster_step_mm = 0.0; },
               {"o.confidence", "'cluster_step_mm' is 0"});
  expect_error([](Confidence& o) { o.parts.reach_mm = 0.1; },
               {"o.confidence.parts", "'reach_mm' is 0.1"});
  expect_error([](Confidence& o) { o.error.parts_factor = 0.0; },
               {"o.confidence.error", "'parts_factor' is 0"});
  expect_error([](Confidence& o) { o.error.sound_speed_share = 0.3; },
               {"o.confidence.error", "'sound_speed_share' is 0.3"});
  expect_error([](Confidence& o) { o.error.sweep_share = -0.1; },
               {"o.confidence.error", "'sweep_share' is -0.1"});
  expect_error([](Confidence& o) { o.error.lag_frames = -1.0; },
               {"o.confidence.error", "'lag_frames' is -1"});
  expect_error([](Confidence& o) { o.error.other_mm = kNan; },
               {"o.confidence.error", "'other_mm' is nan"});
  expect_error([](Confidence& o) { o.error.bound_factor = 0.0; },
               {"o.confidence.error", "'bound_factor' is 0"});
  expect_error([](Confidence& o) { o.error.target_radius_mm = 0.0; },
               {"o.confidence.error", "'target_radius_mm' is 0"});
}

}  // namespace
}  // namespace usct::test
