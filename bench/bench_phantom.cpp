#include <benchmark/benchmark.h>
#include <omp.h>
#include <sys/resource.h>

#include "us_ct_registration/phantom/phantom.h"

/// Items are voxels of CT and ultrasound together; `peak_MiB` is the peak memory of the whole
/// process so far.
namespace usct::phantom {
namespace {

void finish(benchmark::State& state, std::size_t items) {
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations()) *
                          static_cast<std::int64_t>(items));
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  state.counters["peak_MiB"] = static_cast<double>(usage.ru_maxrss) / 1024.0;
  state.counters["threads"] = omp_get_max_threads();
}

/// A full case: ultrasound of 154 x 128 x 81, CT of 320 x 220 x 110.
void full_case(benchmark::State& state, SceneKind scene, SweepKind sweep) {
  PhantomOptions options;
  options.scene = scene;
  options.sweep.kind = sweep;
  std::size_t voxels = 0;
  for (auto _ : state) {
    const PhantomCase phantom = make_phantom(options);
    voxels = phantom.ct.voxels.size() + phantom.ultrasound.voxels.size();
    ++options.seed;
  }
  finish(state, voxels);
}
BENCHMARK_CAPTURE(full_case, agar, SceneKind::kAgar, SweepKind::kMotorised)
    ->Unit(benchmark::kSecond)
    ->Iterations(1)
    ->UseRealTime();
BENCHMARK_CAPTURE(full_case, patient, SceneKind::kPatient, SweepKind::kMotorised)
    ->Unit(benchmark::kSecond)
    ->Iterations(1)
    ->UseRealTime();
BENCHMARK_CAPTURE(full_case, patient_tracked, SceneKind::kPatient, SweepKind::kTrackedCurvilinear)
    ->Unit(benchmark::kSecond)
    ->Iterations(1)
    ->UseRealTime();

}  // namespace
}  // namespace usct::phantom
