#include "finish.h"
#include "us_ct_registration/phantom/phantom.h"

namespace usct::phantom {
namespace {

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
  finish(state, static_cast<std::int64_t>(voxels));  // voxels of CT and ultrasound together
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
