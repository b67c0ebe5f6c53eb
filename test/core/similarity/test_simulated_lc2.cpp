#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <thread>

#include "core/geometry/random_geometry.h"
#include "core/similarity/instructions.h"
#include "core/simulation/simple_scenes.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/similarity/simulated_lc2.h"

namespace usct::test {
namespace {

/// Everything that an evaluation depends on.
struct SimulatedCase {
  BeamUltrasound ultrasound;
  std::vector<std::uint8_t> excluded;  // not 0 where a sample is not known; or empty
  CtVolume ct;
  SimulationOptions simulation;
  FitOptions fit;
  Eigen::Isometry3d T_ct_us = Eigen::Isometry3d::Identity();
  AcquisitionErrors errors;
};

std::shared_ptr<const Similarity> similarity_at(const SimulatedCase& c) {
  BeamUltrasound ultrasound = c.ultrasound;
  for (const std::uint8_t reasons : c.excluded) ultrasound.known.push_back(reasons == 0 ? 255 : 0);
  return make_simulated_lc2(ultrasound, c.ct, c.simulation, c.fit);
}

SimulatedUltrasound reference(const SimulatedCase& c) {
  BeamGrid beams = c.ultrasound.beams;
  beams.axial.start_depth_mm *= 1.0 + c.errors.depth;
  beams.axial.spacing_mm *= 1.0 + c.errors.depth;
  return fit_to_ultrasound(simulate_components(beams, c.ct, c.T_ct_us, c.simulation),
                           c.ultrasound.brightness, c.excluded, c.fit);
}

/// Soft tissue with structure on the scale of a few voxels, air around it, bone and gas within.
CtVolume anatomy(const Grid& grid, double gas_and_bone) {
  const Eigen::Vector3d middle = grid.centre_mm();
  const Eigen::Vector3d half = 0.5 * grid.size.cast<double>().cwiseProduct(grid.spacing_mm);
  return ct_of(grid, [&](const Eigen::Vector3d& p) {
    const Eigen::Vector3d q =
        (grid.direction.transpose() * (p - middle)).cwiseQuotient(half);  // +-1 at the borders
    if (q.y() < -0.8 + 0.1 * std::sin(9.0 * q.x())) return -1000.0;
    const double lump = std::sin(5.0 * q.x() + 1.0) * std::sin(6.0 * q.y()) * std::sin(4.0 * q.z());
    if (gas_and_bone > 0.0 && lump > 1.0 - gas_and_bone) return 900.0;
    if (gas_and_bone > 0.0 && lump < -1.0 + gas_and_bone) return -900.0;
    return 60.0 + 110.0 * lump + 25.0 * std::sin(31.0 * q.x() + 17.0 * q.y() + 23.0 * q.z());
  });
}

BeamGrid fan(int samples, int lines, int frames) {
  ScanGeometry geometry;
  geometry.axial = {samples, 2.0, 50.0 / samples};
  CurvilinearArray array{40.0, {}};
  for (int line = 0; line < lines; ++line)
    array.line_angles_rad.push_back(0.9 * ((line + 0.5) / lines - 0.5));
  MotorSweep sweep;
  sweep.motor_radius_mm = 27.25;
  for (int frame = 0; frame < frames; ++frame)
    sweep.frame_angles_rad.push_back(0.7 * ((frame + 0.5) / frames - 0.5));
  geometry.array = array;
  geometry.motion = sweep;
  return beam_grid(geometry);
}

/// A grid around the middle of the fan, oblique and anisotropic.
Grid grid_in_view(const Eigen::Vector3i& size) {
  Grid grid;
  grid.size = size;
  grid.spacing_mm = Eigen::Vector3d(70.0, 60.0, 60.0).cwiseQuotient(size.cast<double>());
  grid.direction =
      Eigen::AngleAxisd(0.15, Eigen::Vector3d(1.0, -2.0, 0.5).normalized()).toRotationMatrix();
  grid.origin_mm = Eigen::Vector3d(0.0, 68.0, 0.0) - grid.centre_mm();
  return grid;
}

SimulationOptions random_simulation() {
  SimulationOptions options;
  const auto maybe = [] { return *rc::gen::arbitrary<bool>(); };
  options.interpolation = maybe() ? Interpolation::kNearest : Interpolation::kTrilinear;
  options.log_compression = maybe() ? LogCompression::kReflection : LogCompression::kIntensity;
  options.signed_reflection = maybe();
  options.outside_hu = uniform(0.0, 80.0);
  if (maybe()) options.window = HuWindow{-150.0, 400.0};
  if (maybe()) options.transmission_length_mm = uniform(0.3, 5.0);
  options.gradient_length_mm = uniform(0.5, 4.0);
  options.occlusion.by_threshold = maybe();
  if (maybe()) options.occlusion.gradient_hu_per_mm = uniform(150.0, 400.0);
  if (maybe()) options.occlusion.echo_mm = uniform(0.1, 8.0);
  options.log_a = uniform(5.0, 50.0);
  options.reflection_scale = uniform(20.0, 200.0);
  options.map.clamp = maybe();
  return options;
}

/// Ultrasound that a shifted simulation of the CT explains in part, and all options at random.
SimulatedCase random_simulated_case() {
  SimulatedCase c;
  c.ultrasound.beams = fan(integer(20, 60), integer(3, 40), integer(2, 6));
  c.ct = anatomy(grid_in_view({integer(20, 60), integer(20, 60), integer(20, 60)}),
                 integer(0, 3) * 0.1);
  c.simulation = random_simulation();
  const SimulatedComponents there =
      simulate_components(c.ultrasound.beams, c.ct, c.T_ct_us, c.simulation);
  for (std::size_t i = 0; i < there.count(); ++i)
    c.ultrasound.brightness.push_back(30.0F + 0.3F * there.mapped_ct[i] +
                                      60.0F * there.reflection[i] +
                                      static_cast<float>((i * 7919) % 61));
  if (*rc::gen::arbitrary<bool>())
    for (std::size_t i = 0; i < there.count(); ++i)
      c.excluded.push_back(i % 11 == 0 || i % 97 > 80 ? 4 : 0);
  c.fit.use_background = *rc::gen::arbitrary<bool>();
  if (*rc::gen::arbitrary<bool>()) c.fit.fixed_weights = SimulationWeights{0.4, 50.0, 40.0};
  c.T_ct_us.linear() = Eigen::AngleAxisd(uniform(-0.4, 0.4), Eigen::Vector3d(1, 2, 3).normalized())
                           .toRotationMatrix();
  for (int axis = 0; axis < 3; ++axis) c.T_ct_us.translation()[axis] = uniform(-40.0, 40.0);
  c.errors.depth = uniform(-0.05, 0.05);
  return c;
}

/// The greatest difference of value and overlap from the reference, over all instructions.
double error_of(const SimulatedCase& c) {
  const SimulatedUltrasound expected = reference(c);
  double error = 0.0;
  for (const std::int64_t target : Instructions::all()) {
    const Instructions instructions(target);
    const SimilarityValue value = similarity_at(c)->evaluate(SimilarityPose{c.T_ct_us, c.errors});
    if (std::isnan(value.value) == expected.has_fit())
      return std::numeric_limits<double>::infinity();
    error = std::max(error, std::abs(value.overlap - expected.overlap));
    if (expected.has_fit()) error = std::max(error, std::abs(value.value - expected.lc2));
  }
  return error;
}

/// How much the reference changes where the ultrasound moves by some roundings of single precision.
/// A sample on a threshold then comes to lie on the other side, and a whole beam behind it may be
/// occluded.
double change_by_rounding(const SimulatedCase& c) {
  constexpr double kStepMm = 1e-4;
  const SimulatedUltrasound here = reference(c);
  double change = 0.0;
  for (int axis = 0; axis < 3; ++axis)
    for (const double step : {-kStepMm, kStepMm}) {
      SimulatedCase moved = c;
      moved.T_ct_us.translation()[axis] += step;
      const SimulatedUltrasound there = reference(moved);
      if (there.has_fit() != here.has_fit()) return std::numeric_limits<double>::infinity();
      change = std::max(change, std::abs(there.overlap - here.overlap));
      if (here.has_fit()) change = std::max(change, std::abs(there.lc2 - here.lc2));
    }
  return change;
}

RC_GTEST_PROP(SimulatedLc2, IsTheReferenceForAnyOptionsAndPose, ()) {
  const SimulatedCase c = random_simulated_case();
  // A sample on a threshold or half-way between voxels may be rounded to either side.
  const auto samples = static_cast<double>(c.ultrasound.brightness.size());
  const double error = error_of(c);
  RC_ASSERT(error < 1e-5 + 2.0 / samples || error <= 2.0 * change_by_rounding(c));
}

/// A case with air, bone and gas whose ultrasound lies in the CT except for a corner.
SimulatedCase make_fixed_case() {
  SimulatedCase c;
  c.ultrasound.beams = fan(120, 37, 9);
  c.ct = anatomy(grid_in_view({80, 70, 60}), 0.1);
  c.T_ct_us = Eigen::Translation3d(3.0, -2.0, 4.0) *
              Eigen::AngleAxisd(0.1, Eigen::Vector3d(1, 2, 3).normalized());
  const SimulatedComponents there =
      simulate_components(c.ultrasound.beams, c.ct, Eigen::Isometry3d::Identity(), {});
  for (std::size_t i = 0; i < there.count(); ++i)
    c.ultrasound.brightness.push_back(30.0F + 0.5F * there.mapped_ct[i] +
                                      60.0F * there.reflection[i] +
                                      static_cast<float>((i * 7919) % 61));
  return c;
}

SimulatedCase fixed_case() {
  static const SimulatedCase c = make_fixed_case();
  return c;
}

constexpr double kSimulatedTolerance = 2e-6;

TEST(SimulatedLc2, IsTheReferenceToSixDigitsOptionByOption) {
  EXPECT_LT(error_of(fixed_case()), kSimulatedTolerance);
  for (const auto interpolation : {Interpolation::kNearest, Interpolation::kTrilinear})
    for (const auto compression : {LogCompression::kReflection, LogCompression::kIntensity})
      for (const bool by_threshold : {false, true})
        for (const bool windowed : {false, true}) {
          SimulatedCase c = fixed_case();
          c.simulation.interpolation = interpolation;
          c.simulation.log_compression = compression;
          c.simulation.occlusion.by_threshold = by_threshold;
          if (windowed) c.simulation.window = HuWindow{};
          EXPECT_LT(error_of(c), kSimulatedTolerance)
              << static_cast<int>(interpolation) << static_cast<int>(compression) << by_threshold
              << windowed;
        }
  const auto expect_equal_with = [](const char* what,
                                    const std::function<void(SimulatedCase&)>& change) {
    SimulatedCase c = fixed_case();
    c.simulation.occlusion.by_threshold = true;
    const double before = reference(c).lc2;
    change(c);
    EXPECT_NE(reference(c).lc2, before) << what << " makes no difference";
    EXPECT_LT(error_of(c), kSimulatedTolerance) << what;
  };
  expect_equal_with("sign", [](SimulatedCase& c) { c.simulation.signed_reflection = true; });
  expect_equal_with("no clamp", [](SimulatedCase& c) { c.simulation.map.clamp = false; });
  expect_equal_with("length", [](SimulatedCase& c) { c.simulation.gradient_length_mm = 3.0; });
  expect_equal_with("gradient",
                    [](SimulatedCase& c) { c.simulation.occlusion.gradient_hu_per_mm = 120.0; });
  expect_equal_with("echo", [](SimulatedCase& c) { c.simulation.occlusion.echo_mm = 3.0; });
  expect_equal_with("echo of lost sound", [](SimulatedCase& c) {
    c.simulation.occlusion.echo_mm = 3.0;
    c.simulation.log_compression = LogCompression::kIntensity;
  });
  expect_equal_with("gas", [](SimulatedCase& c) { c.simulation.occlusion.gas_hu = -200.0; });
  expect_equal_with("outside", [](SimulatedCase& c) { c.simulation.outside_hu = 120.0; });
  expect_equal_with("background", [](SimulatedCase& c) { c.fit.use_background = false; });
  expect_equal_with("weights", [](SimulatedCase& c) {
    c.fit.fixed_weights = SimulationWeights{.4, 50, 40};
  });
  expect_equal_with("depth", [](SimulatedCase& c) { c.errors.depth = 0.02; });
  expect_equal_with("path", [](SimulatedCase& c) {
    c.simulation.log_compression = LogCompression::kIntensity;
    c.simulation.transmission_length_mm = 0.9;
  });
  expect_equal_with("excluded", [](SimulatedCase& c) {
    c.excluded.assign(c.ultrasound.brightness.size(), 0);
    for (std::size_t i = 0; i < c.excluded.size(); ++i) c.excluded[i] = i % 120 < 30 || i % 7 == 0;
  });
  // Beams at the sides enter the fan late or never.
  expect_equal_with("scan-converted ultrasound", [](SimulatedCase& c) {
    for (int frame = 0; frame < 9; ++frame)
      for (int line = 0; line < 37; ++line)
        for (int sample = 0; sample < 120; ++sample)
          c.excluded.push_back(10 * (std::abs(line - 20) + frame) > 20 + sample ? 1 : 0);
  });
}

TEST(SimulatedLc2, WhatIsNotKnownMayBeAnything) {
  SimulatedCase c = fixed_case();
  c.excluded.assign(c.ultrasound.brightness.size(), 0);
  for (std::size_t i = 0; i < c.excluded.size(); i += 3) c.excluded[i] = 1;
  const double expected = similarity_at(c)->evaluate(SimilarityPose{c.T_ct_us, {}}).value;
  for (std::size_t i = 0; i < c.excluded.size(); i += 3) c.ultrasound.brightness[i] = std::nanf("");
  EXPECT_EQ(similarity_at(c)->evaluate(SimilarityPose{c.T_ct_us, {}}).value, expected);
}

TEST(SimulatedLc2, OddCtsAreSampledAsByTheReference) {
  for (const Eigen::Vector3i& size :
       {Eigen::Vector3i(1, 40, 40), Eigen::Vector3i(40, 1, 40), Eigen::Vector3i(40, 40, 1),
        Eigen::Vector3i(2, 3, 2), Eigen::Vector3i(1, 1, 1)}) {
    SimulatedCase c = fixed_case();
    c.ct = anatomy(grid_in_view(size), 0.0);
    for (std::int16_t& hu : c.ct.voxels) hu = std::max<std::int16_t>(hu, 0);
    EXPECT_LT(error_of(c), kSimulatedTolerance) << size.transpose();
  }
  SimulatedCase c = fixed_case();  // differences that exceed 16 bits
  for (std::size_t i = 0; i < c.ct.voxels.size(); ++i)
    c.ct.voxels[i] = static_cast<std::int16_t>((i * 40503) % 65536 - 32768);
  c.simulation.gradient_length_mm = 1e-3;
  c.simulation.hu_shift = 40000.0;
  c.simulation.occlusion.gas_hu = -1e6;
  c.simulation.map = {0.01, 0.0, false};
  EXPECT_LT(error_of(c), 1e-5);
}

TEST(SimulatedLc2, SameBitsFromSeveralThreads) {
  const SimulatedCase c = fixed_case();
  const auto similarity = similarity_at(c);
  const SimilarityValue expected = similarity->evaluate(SimilarityPose{c.T_ct_us, {}});
  std::vector<SimilarityValue> values(8);
  std::vector<std::thread> threads;
  threads.reserve(values.size());
  for (SimilarityValue& value : values)
    threads.emplace_back([&] { value = similarity->evaluate(SimilarityPose{c.T_ct_us, {}}); });
  for (std::thread& thread : threads) thread.join();
  for (const SimilarityValue& value : values) {
    EXPECT_EQ(value.value, expected.value);
    EXPECT_EQ(value.overlap, expected.overlap);
  }
}

RC_GTEST_PROP(SimulatedLc2, DoesNotDependOnGainAndOffset, ()) {
  SimulatedCase c = fixed_case();
  const double before = similarity_at(c)->evaluate(SimilarityPose{c.T_ct_us, {}}).value;
  const auto gain = static_cast<float>(uniform(0.1, 10.0) * (integer(0, 2) == 0 ? -1.0 : 1.0));
  const auto offset = static_cast<float>(uniform(-300.0, 300.0));
  for (float& u : c.ultrasound.brightness) u = gain * u + offset;
  RC_ASSERT(std::abs(similarity_at(c)->evaluate(SimilarityPose{c.T_ct_us, {}}).value - before) <
            1e-6);
}

TEST(SimulatedLc2, IsHighestWhereTheUltrasoundWasSimulated) {
  for (const auto compression : {LogCompression::kReflection, LogCompression::kIntensity}) {
    SimulatedCase c = fixed_case();
    c.simulation.log_compression = compression;
    const SimulatedComponents there =
        simulate_components(c.ultrasound.beams, c.ct, c.T_ct_us, c.simulation);
    for (std::size_t i = 0; i < there.count(); ++i)
      c.ultrasound.brightness[i] =
          (there.flags[i] & kOccluded) != 0
              ? 55.0F
              : 20.0F + 0.4F * there.mapped_ct[i] + 70.0F * there.reflection[i];
    const auto similarity = similarity_at(c);
    const double best = similarity->evaluate(SimilarityPose{c.T_ct_us, {}}).value;
    EXPECT_GT(best, 0.99999);
    for (int axis = 0; axis < 3; ++axis)
      for (const double step : {-6.0, -2.0, -0.5, 0.5, 2.0, 6.0}) {
        Eigen::Isometry3d moved = c.T_ct_us;
        moved.translation()[axis] += step;
        EXPECT_LT(similarity->evaluate(SimilarityPose{moved, {}}).value, best - 1e-3);
        const Eigen::Isometry3d turned =
            c.T_ct_us * Eigen::AngleAxisd(step * kDegree, Eigen::Vector3d::Unit(axis));
        EXPECT_LT(similarity->evaluate(SimilarityPose{turned, {}}).value, best - 1e-3);
      }
    for (const double depth : {-0.05, -0.01, 0.01, 0.05})
      EXPECT_LT(similarity->evaluate(SimilarityPose{c.T_ct_us, {depth, 0.0}}).value, best - 1e-3);
  }
}

TEST(SimulatedLc2, SaysNothingWhereTheReferenceHasNoFit) {
  const auto expect_nothing = [](FitStatus status, const SimulatedCase& c) {
    const SimulatedUltrasound expected = reference(c);
    EXPECT_EQ(expected.status, status);
    const SimilarityValue value = similarity_at(c)->evaluate(SimilarityPose{c.T_ct_us, {}});
    EXPECT_TRUE(std::isnan(value.value)) << to_string(status);
    EXPECT_NEAR(value.overlap, expected.overlap, 1e-12) << to_string(status);
  };
  SimulatedCase c = fixed_case();
  c.T_ct_us.translation().x() = 500.0;
  expect_nothing(FitStatus::kNoOverlap, c);
  c = fixed_case();
  c.fit.min_overlap = 1.0;
  expect_nothing(FitStatus::kNoOverlap, c);
  c = fixed_case();
  c.excluded.assign(c.ultrasound.brightness.size(), 1);
  expect_nothing(FitStatus::kNoUsableUltrasound, c);
  c = fixed_case();
  std::fill(c.ultrasound.brightness.begin(), c.ultrasound.brightness.end(), 77.3F);
  expect_nothing(FitStatus::kConstantUltrasound, c);
  c = fixed_case();
  std::fill(c.ct.voxels.begin(), c.ct.voxels.end(), std::int16_t{40});
  expect_nothing(FitStatus::kNoContrast, c);
  c = fixed_case();
  std::fill(c.ct.voxels.begin(), c.ct.voxels.end(), std::int16_t{900});
  c.simulation.occlusion.by_threshold = true;
  c.fit.use_background = false;
  expect_nothing(FitStatus::kAllOccluded, c);
}

TEST(SimulatedLc2, RefusesWhatIsWrong) {
  const SimulatedCase c = fixed_case();
  const auto similarity = similarity_at(c);
  EXPECT_THROW(similarity->evaluate(SimilarityPose{c.T_ct_us, {0.0, 0.01}}), InputError);
  EXPECT_THROW(similarity->evaluate(SimilarityPose{c.T_ct_us, {-1.0, 0.0}}), InputError);
  EXPECT_THROW(similarity->evaluate(SimilarityPose{c.T_ct_us, {std::nan(""), 0.0}}), InputError);
  Eigen::Isometry3d sheared = c.T_ct_us;
  sheared.matrix()(0, 1) += 0.1;
  EXPECT_THROW(similarity->evaluate(SimilarityPose{sheared, {}}), InputError);
  const auto expect_refused = [](const std::function<void(SimulatedCase&)>& change) {
    SimulatedCase bad = fixed_case();
    change(bad);
    EXPECT_THROW(similarity_at(bad), InputError);
  };
  expect_refused([](SimulatedCase& b) { b.ultrasound.brightness[7] = std::nanf(""); });
  expect_refused([](SimulatedCase& b) { b.ultrasound.brightness.pop_back(); });
  expect_refused([](SimulatedCase& b) { b.ultrasound.beams.lines = 0; });
  expect_refused([](SimulatedCase& b) { b.excluded.assign(3, 0); });
  expect_refused([](SimulatedCase& b) { b.ct.voxels.pop_back(); });
  expect_refused([](SimulatedCase& b) { b.simulation.log_a = 0.0; });
  expect_refused([](SimulatedCase& b) { b.fit.min_overlap = 2.0; });
}

}  // namespace
}  // namespace usct::test
