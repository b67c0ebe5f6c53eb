#include <malloc.h>

#include <chrono>
#include <fstream>
#include <limits>
#include <map>
#include <memory>

#include "finish.h"
#include "us_ct_registration/evaluation/perturbation.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/io/options/registration_options_io.h"
#include "us_ct_registration/phantom/phantom.h"
#include "us_ct_registration/registration/registration.h"
#include "us_ct_registration/registration/tracking.h"
#include "us_ct_registration/volume/operations.h"

namespace usct {
namespace {

using phantom::PhantomCase;
using phantom::SceneKind;

/// Ultrasound of 154 x 128 x 81, CT of 320 x 220 x 110.
const PhantomCase& full_case(SceneKind scene) {
  static std::map<SceneKind, PhantomCase> cases;
  const auto [it, is_new] = cases.try_emplace(scene);
  if (is_new) {
    phantom::PhantomOptions options;
    options.scene = scene;
    options.seed = 101;
    it->second = phantom::make_phantom(options);
    it->second.labels = {};
  }
  return it->second;
}

/// The same CT in the middle of a larger one, into which its outermost voxels are continued.
CtVolume in_larger(const CtVolume& ct, const Eigen::Vector3i& size) {
  const Eigen::Vector3i before = (size - ct.grid.size) / 2;
  Grid grid = ct.grid;
  grid.size = size;
  grid.origin_mm = ct.grid.physical_from_index(-before.cast<double>());
  return resample(ct, grid, Eigen::Isometry3d::Identity(), Interpolation::kNearest,
                  Outside::edge());
}

/// Resets the peak, since making the phantom takes more memory than registering it.
void forget_peak_memory() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << "5";
}

enum class Ct { kAsItIs, kPrepared };

/// One registration per iteration, from a start 10 mm off, in another direction each time.
void registration(benchmark::State& state, const char* preset_name, SceneKind scene,
                  const Eigen::Vector3i& ct_size, Ct kind = Ct::kAsItIs) {
  constexpr double kDisplacementMm = 10.0;
  constexpr double kMaxRotationRad = 0.2;
  const PhantomCase& phantom = full_case(scene);
  const CtVolume ct = in_larger(phantom.ct, ct_size);
  const RegistrationOptions options = preset(preset_name);
  const BeamUltrasound us = along_beams(phantom.ultrasound);
  const ThreadCount threads(static_cast<int>(state.range(0)));
  const auto begin = std::chrono::steady_clock::now();
  const auto prepared = kind == Ct::kPrepared ? std::make_unique<PreparedCt>(ct, options)
                                              : std::make_unique<PreparedCt>(ct);
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
  forget_peak_memory();
  std::map<std::string, double> seconds;
  double tre_mm = 0.0;
  double registered = 0.0;
  std::uint64_t seed = 0;
  for (auto _ : state) {
    const Eigen::Isometry3d motion =
        random_motion(++seed, phantom.truth.targets_us_mm, kDisplacementMm, kMaxRotationRad);
    const RegistrationResult result =
        register_ultrasound(us, *prepared, motion * phantom.truth.T_us_ct, options);
    for (const auto& [stage, taken] : result.seconds) seconds[stage] += taken;
    if (!result.T_us_ct) continue;
    registered += 1.0;
    tre_mm += evaluate_targets(*result.T_us_ct, phantom.truth.T_us_ct, phantom.truth.targets_us_mm)
                  .mean_mm;
  }
  finish(state, static_cast<std::int64_t>(us.brightness.size()));
  if (kind == Ct::kPrepared) {
    state.counters["preparation_ms"] = took.count();
    state.counters["prepared_MiB"] = static_cast<double>(prepared->bytes()) / (1 << 20);
  }
  state.counters["registered"] = registered / static_cast<double>(seed);
  state.counters["tre_mm"] = tre_mm / registered;
  for (const auto& [stage, taken] : seconds)
    state.counters[stage + "_ms"] = 1000.0 * taken / static_cast<double>(seed);
}

/// One tracked registration per iteration, from a pose that is a little off; CT prepared.
void tracking(benchmark::State& state, const char* preset_name, SceneKind scene) {
  constexpr double kMovedMm = 0.5;
  constexpr double kMaxRotationRad = 0.01;
  const PhantomCase& phantom = full_case(scene);
  const RegistrationOptions options = preset(preset_name);
  const BeamUltrasound us = along_beams(phantom.ultrasound);
  const ThreadCount threads(static_cast<int>(state.range(0)));
  const PreparedCt ct(phantom.ct, options);
  RegistrationTracker tracker(options, {std::numeric_limits<int>::max()});
  if (!tracker.next(us, ct, phantom.truth.T_us_ct).T_us_ct) return state.SkipWithError("refused");
  forget_peak_memory();
  std::map<std::string, double> seconds;
  double tre_mm = 0.0;
  double tracked = 0.0;
  std::uint64_t seed = 0;
  for (auto _ : state) {
    const Eigen::Isometry3d motion =
        random_motion(++seed, phantom.truth.targets_us_mm, kMovedMm, kMaxRotationRad);
    const RegistrationResult result = tracker.next(us, ct, motion * phantom.truth.T_us_ct);
    for (const auto& [stage, taken] : result.seconds) seconds[stage] += taken;
    if (!result.T_us_ct || result.seconds.count("search") != 0) continue;
    tracked += 1.0;
    tre_mm += evaluate_targets(*result.T_us_ct, phantom.truth.T_us_ct, phantom.truth.targets_us_mm)
                  .mean_mm;
  }
  finish(state, static_cast<std::int64_t>(us.brightness.size()));
  state.counters["tracked"] = tracked / static_cast<double>(seed);
  state.counters["tre_mm"] = tre_mm / tracked;
  for (const auto& [stage, taken] : seconds)
    state.counters[stage + "_ms"] = 1000.0 * taken / static_cast<double>(seed);
}

const Eigen::Vector3i kUsual(320, 220, 110);
const Eigen::Vector3i kLarge(512, 512, 300);
constexpr auto kMs = benchmark::kMillisecond;
constexpr auto kAgar = SceneKind::kAgar;
constexpr auto kPatient = SceneKind::kPatient;
BENCHMARK_CAPTURE(tracking, patient, "patient", kPatient)->Arg(2)->Unit(kMs)->UseRealTime();
BENCHMARK_CAPTURE(registration, phantom, "phantom", kAgar, kUsual)
    ->Arg(1)
    ->Arg(2)
    ->Unit(kMs)
    ->UseRealTime();
BENCHMARK_CAPTURE(registration, fast, "fast", kAgar, kUsual)
    ->Arg(1)
    ->Arg(2)
    ->Unit(kMs)
    ->UseRealTime();
BENCHMARK_CAPTURE(registration, patient, "patient", kPatient, kUsual)
    ->Arg(1)
    ->Arg(2)
    ->Unit(kMs)
    ->UseRealTime();
BENCHMARK_CAPTURE(registration, phantom_large_ct, "phantom", kAgar, kLarge)
    ->Arg(2)
    ->Unit(kMs)
    ->UseRealTime();
BENCHMARK_CAPTURE(registration, patient_prepared_ct, "patient", kPatient, kUsual, Ct::kPrepared)
    ->Arg(2)
    ->Unit(kMs)
    ->UseRealTime();
BENCHMARK_CAPTURE(registration, patient_large_ct, "patient", kPatient, kLarge)
    ->Arg(2)
    ->Unit(kMs)
    ->UseRealTime();
BENCHMARK_CAPTURE(registration, patient_large_prepared_ct, "patient", kPatient, kLarge,
                  Ct::kPrepared)
    ->Arg(2)
    ->Unit(kMs)
    ->UseRealTime();

}  // namespace
}  // namespace usct
