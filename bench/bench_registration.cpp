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

/// What registrations took and how exact they were, for the counters.
class Tally {
 public:
  explicit Tally(const PhantomCase& phantom) : phantom_(phantom) {}

  /// A start beside the truth, in another direction each time.
  Eigen::Isometry3d next_start(double displacement_mm, double most_rad) {
    return random_motion(++runs_, phantom_.truth.targets_us_mm, displacement_mm, most_rad) *
           phantom_.truth.T_us_ct;
  }
  void add(const RegistrationResult& result, bool counts) {
    for (const auto& [step, taken] : result.seconds) seconds_[step] += taken;
    if (!counts) return;
    counted_ += 1.0;
    tre_mm_ +=
        evaluate_targets(*result.T_us_ct, phantom_.truth.T_us_ct, phantom_.truth.targets_us_mm)
            .mean_mm;
  }
  void write(benchmark::State& state, const char* counted) const {
    state.counters[counted] = counted_ / static_cast<double>(runs_);
    state.counters["tre_mm"] = tre_mm_ / counted_;
    for (const auto& [step, taken] : seconds_)
      state.counters[step + "_ms"] = 1000.0 * taken / static_cast<double>(runs_);
  }

 private:
  const PhantomCase& phantom_;
  std::map<std::string, double> seconds_;
  double tre_mm_ = 0.0;
  double counted_ = 0.0;
  std::uint64_t runs_ = 0;
};

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
  Tally tally(phantom);
  for (auto _ : state) {
    const RegistrationResult result = register_ultrasound(
        us, *prepared, tally.next_start(kDisplacementMm, kMaxRotationRad), options);
    tally.add(result, result.T_us_ct.has_value());
  }
  finish(state, static_cast<std::int64_t>(us.brightness.size()));
  if (kind == Ct::kPrepared) {
    state.counters["preparation_ms"] = took.count();
    state.counters["prepared_MiB"] = static_cast<double>(prepared->bytes()) / (1 << 20);
  }
  tally.write(state, "registered");
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
  Tally tally(phantom);
  for (auto _ : state) {
    const RegistrationResult result =
        tracker.next(us, ct, tally.next_start(kMovedMm, kMaxRotationRad));
    tally.add(result, result.T_us_ct && result.seconds.count("search") == 0);
  }
  finish(state, static_cast<std::int64_t>(us.brightness.size()));
  tally.write(state, "tracked");
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
