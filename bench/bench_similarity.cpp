#include <hwy/targets.h>

#include <cmath>

#include "finish.h"
#include "similarity/packed_ct.h"
#include "similarity/ultrasound_patches.h"
#include "ultrasound/decimation.h"
#include "us_ct_registration/similarity/catalogue.h"
#include "us_ct_registration/ultrasound/conditioning.h"

namespace usct {
namespace {

/// The thesis' sizes: 128 lines x 154 samples x 81 frames, without structure of its own.
BeamUltrasound thesis_ultrasound() {
  ScanGeometry geometry;
  geometry.axial = {154, 2.0, 0.7};
  CurvilinearArray array{40.0, {}};
  for (int line = 0; line < 128; ++line) array.line_angles_rad.push_back(0.010625 * (line - 63.5));
  MotorSweep sweep;
  sweep.motor_radius_mm = 27.25;
  for (int frame = 0; frame < 81; ++frame) sweep.frame_angles_rad.push_back(0.01277 * (frame - 40));
  geometry.array = array;
  geometry.motion = sweep;
  BeamUltrasound us{beam_grid(geometry), {}, {}};
  const std::size_t count = us.beams.beams.size() * static_cast<std::size_t>(us.beams.samples());
  for (std::size_t i = 0; i < count; ++i)
    us.brightness.push_back(static_cast<float>((i * 7919) % 61) +
                            20.0F * std::sin(0.002F * static_cast<float>(i % 19712)));
  return us;
}

const BeamUltrasound& ultrasound() {
  static const BeamUltrasound result = thesis_ultrasound();
  return result;
}

/// A CT that covers nearly all of the field.
Volume<float> ct(double spacing_mm) {
  Grid grid;
  grid.spacing_mm.setConstant(spacing_mm);
  const Eigen::Vector3d extent_mm(170.0, 130.0, 130.0);
  grid.size = (extent_mm / spacing_mm).cast<int>();
  grid.origin_mm = Eigen::Vector3d(0.0, 95.0, 0.0) - 0.5 * extent_mm;
  Volume<float> volume(grid);
  for (int k = 0; k < grid.size.z(); ++k)
    for (int j = 0; j < grid.size.y(); ++j)
      for (int i = 0; i < grid.size.x(); ++i) {
        const Eigen::Vector3d p = grid.physical_from_index({1.0 * i, 1.0 * j, 1.0 * k});
        volume.at(i, j, k) = static_cast<float>(
            40.0 + 90.0 * std::sin(0.3 * p.x()) * std::sin(0.2 * p.y()) * std::sin(0.25 * p.z()));
      }
  return volume;
}

Eigen::Isometry3d pose() {
  return Eigen::Isometry3d(Eigen::AngleAxisd(0.1, Eigen::Vector3d(1, 2, 3).normalized()));
}

/// Restricts the kernel to these instructions; 0 allows all that the machine has.
void use_target(std::int64_t target) {
  hwy::SetSupportedTargetsForTest(target);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

constexpr std::int64_t kScalar = -1;

void evaluate(benchmark::State& state, const char* metric, std::int64_t target, int factor,
              double ct_mm, const AcquisitionErrors& errors) {
  use_target(0);
  if (target > 0 && (hwy::SupportedTargets() & target) == 0) {
    state.SkipWithError("this processor lacks the instructions");
    return;
  }
  const ThreadCount threads(1);
  SimilarityImages images(std::make_shared<const BeamUltrasound>(
                              decimate(ultrasound(), Eigen::Vector3i::Constant(factor))),
                          pack_ct(ct(ct_mm), HuWindow{}, 40.0), nullptr, true,
                          target == kScalar ? scalar_backend() : simd_backend());
  const auto similarity = make_similarity(images, similarity_named(metric, "benchmark"));
  const auto patches = images.patches({});
  if (target > 0) use_target(target);
  const SimilarityPose where{pose(), errors};
  state.counters["value"] = similarity->evaluate(where).value;
  state.counters["overlap"] = similarity->evaluate(where).overlap;
  state.counters["patches"] = static_cast<double>(patches->patches.size());
  for (auto _ : state) benchmark::DoNotOptimize(similarity->evaluate(where));
  use_target(0);
  finish(state, static_cast<std::int64_t>(patches->count));
  state.counters["per_sample"] = benchmark::Counter(
      static_cast<double>(patches->count),
      benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void cut(benchmark::State& state, int factor) {
  const ThreadCount threads(static_cast<int>(state.range(0)));
  const BeamUltrasound us = decimate(ultrasound(), Eigen::Vector3i::Constant(factor));
  for (auto _ : state) benchmark::DoNotOptimize(cut_into_patches(us, {}).count);
  finish(state, static_cast<std::int64_t>(us.brightness.size()));
}

void decimation(benchmark::State& state, int factor) {
  const ThreadCount threads(static_cast<int>(state.range(0)));
  const Eigen::Vector3i factors = Eigen::Vector3i::Constant(factor);
  for (auto _ : state) benchmark::DoNotOptimize(decimate(ultrasound(), factors).brightness.data());
  finish(state, static_cast<std::int64_t>(ultrasound().brightness.size()));
}

void conditioning(benchmark::State& state, int factor) {
  const ThreadCount threads(static_cast<int>(state.range(0)));
  const BeamUltrasound us = decimate(ultrasound(), Eigen::Vector3i::Constant(factor));
  for (auto _ : state) benchmark::DoNotOptimize(condition(us, {}).samples.data());
  finish(state, static_cast<std::int64_t>(us.brightness.size()));
}

void packing(benchmark::State& state, double ct_mm) {
  const ThreadCount threads(static_cast<int>(state.range(0)));
  const Volume<float> volume = ct(ct_mm);
  for (auto _ : state) benchmark::DoNotOptimize(PackedCt(volume, HuWindow{}, 40.0).pairs());
  finish(state, static_cast<std::int64_t>(volume.voxels.size()));
}

constexpr auto kMs = benchmark::kMillisecond;
constexpr auto kLocal = "local_lc2";
constexpr AcquisitionErrors kNone{};
BENCHMARK_CAPTURE(evaluate, local_lc2_scalar_2x, kLocal, kScalar, 2, 1.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, local_lc2_avx2_2x, kLocal, HWY_AVX2, 2, 1.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, local_lc2_avx512_2x, kLocal, HWY_AVX3, 2, 1.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, local_lc2_avx2_2x_coarse, kLocal, HWY_AVX2, 2, 2.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, local_lc2_avx512_2x_coarse, kLocal, HWY_AVX3, 2, 2.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, local_lc2_scalar_1x, kLocal, kScalar, 1, 1.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, local_lc2_avx2_1x, kLocal, HWY_AVX2, 1, 1.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, local_lc2_avx512_1x, kLocal, HWY_AVX3, 1, 1.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, local_lc2_avx2_2x_cached, kLocal, HWY_AVX2, 2, 5.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, local_lc2_avx512_2x_cached, kLocal, HWY_AVX3, 2, 5.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, local_lc2_errors, kLocal, 0, 2, 1.0, AcquisitionErrors{0.01, 0.01})
    ->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, global_lc2, "global_lc2", 0, 2, 1.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, mattes_mi, "mattes_mi", 0, 2, 1.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, nmi, "nmi", 0, 2, 1.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, correlation_ratio, "correlation_ratio", 0, 2, 1.0, kNone)->Unit(kMs);
BENCHMARK_CAPTURE(evaluate, joint_correlation_ratio, "joint_correlation_ratio", 0, 2, 1.0, kNone)
    ->Unit(kMs);
BENCHMARK_CAPTURE(cut, cut_2x, 2)->Arg(1)->Arg(2)->Unit(kMs);
BENCHMARK_CAPTURE(cut, cut_1x, 1)->Arg(1)->Arg(2)->Unit(kMs);
BENCHMARK_CAPTURE(decimation, decimate_2x, 2)->Arg(1)->Arg(2)->Unit(kMs);
BENCHMARK_CAPTURE(conditioning, condition_2x, 2)->Arg(1)->Arg(2)->Unit(kMs);
BENCHMARK_CAPTURE(conditioning, condition_1x, 1)->Arg(1)->Arg(2)->Unit(kMs);
BENCHMARK_CAPTURE(packing, packed_ct, 1.0)->Arg(1)->Arg(2)->Unit(kMs);

}  // namespace
}  // namespace usct
