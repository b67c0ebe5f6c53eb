#include <hwy/targets.h>

#include <cmath>

#include "finish.h"
#include "us_ct_registration/similarity/simulated_lc2.h"

namespace usct {
namespace {

/// The thesis' sizes: 128 lines x 154 samples x 81 frames, CT of 320 x 220 x 110.
struct Case {
  BeamUltrasound ultrasound;
  CtVolume ct;
  Eigen::Isometry3d T_ct_us = Eigen::Isometry3d::Identity();
};

const Case& thesis_case() {
  static const Case result = [] {
    Case c;
    Grid grid;
    grid.size = {320, 220, 110};
    grid.spacing_mm = {0.468, 0.468, 1.0};
    grid.origin_mm = {-75.0, 30.0, -55.0};
    c.ct = CtVolume(grid);
    for (int k = 0; k < 110; ++k)
      for (int j = 0; j < 220; ++j)
        for (int i = 0; i < 320; ++i)
          c.ct.at(i, j, k) = static_cast<std::int16_t>(
              40.0 + 90.0 * std::sin(0.11 * i) * std::sin(0.07 * j) * std::sin(0.17 * k) +
              (i * 7 + j * 13 + k * 5) % 17);
    ScanGeometry geometry;
    geometry.axial = {154, 2.0, 0.7};
    CurvilinearArray array{40.0, {}};
    for (int line = 0; line < 128; ++line)
      array.line_angles_rad.push_back(0.010625 * (line - 63.5));
    MotorSweep sweep;
    sweep.motor_radius_mm = 27.25;
    for (int frame = 0; frame < 81; ++frame)
      sweep.frame_angles_rad.push_back(0.01277 * (frame - 40));
    geometry.array = array;
    geometry.motion = sweep;
    c.ultrasound.beams = beam_grid(geometry);
    c.T_ct_us.linear() =
        Eigen::AngleAxisd(0.2, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    const auto simulated = simulate_components(c.ultrasound.beams, c.ct, c.T_ct_us, {});
    for (std::size_t i = 0; i < simulated.count(); ++i)
      c.ultrasound.brightness.push_back(0.5F * simulated.mapped_ct[i] +
                                        static_cast<float>((i * 7919) % 61));
    return c;
  }();
  return result;
}

void finish_samples(benchmark::State& state, std::int64_t samples = static_cast<std::int64_t>(
                                                 thesis_case().ultrasound.brightness.size())) {
  finish(state, samples);
  state.counters["per_sample"] = benchmark::Counter(
      static_cast<double>(samples),
      benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void reference(benchmark::State& state, Interpolation interpolation) {
  const Case& c = thesis_case();
  SimulationOptions options;
  options.interpolation = interpolation;
  const ThreadCount threads(1);
  for (auto _ : state)
    benchmark::DoNotOptimize(
        fit_to_ultrasound(simulate_components(c.ultrasound.beams, c.ct, c.T_ct_us, options),
                          c.ultrasound.brightness, {}, {})
            .lc2);
  finish_samples(state);
}

void fused(benchmark::State& state, std::int64_t target, const SimulationOptions& options) {
  const Case& c = thesis_case();
  hwy::SetSupportedTargetsForTest(0);
  if ((hwy::SupportedTargets() & target) == 0) {
    state.SkipWithError("this processor lacks the instructions");
    return;
  }
  const ThreadCount threads(1);
  hwy::SetSupportedTargetsForTest(target);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  const auto similarity = make_simulated_lc2(c.ultrasound, c.ct, options, {});
  state.counters["lc2"] = similarity->evaluate(SimilarityPose{c.T_ct_us, {}}).value;
  for (auto _ : state)
    benchmark::DoNotOptimize(similarity->evaluate(SimilarityPose{c.T_ct_us, {}}));
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  finish_samples(state);
}

/// What CMA-ES asks for at a time: the poses of a generation in six dimensions, here some
/// millimetres and degrees apart.
void generation(benchmark::State& state) {
  const Case& c = thesis_case();
  const ThreadCount threads(1);
  std::vector<SimilarityPose> poses;
  for (int i = 0; i < 9; ++i) {
    const auto offset = [i](int axis) { return std::sin(1.0 + 2.3 * i + 1.7 * axis); };
    Eigen::Isometry3d T = c.T_ct_us;
    T.translation() += 2.0 * Eigen::Vector3d(offset(0), offset(1), offset(2));
    T.rotate(Eigen::AngleAxisd(0.03 * offset(3), Eigen::Vector3d(1, i, 2).normalized()));
    poses.push_back({T, {}});
  }
  std::vector<SimilarityValue> values(poses.size());
  const auto similarity = make_simulated_lc2(c.ultrasound, c.ct, {}, {});
  for (auto _ : state) {
    similarity->evaluate(poses.data(), poses.size(), values.data(), {});
    benchmark::DoNotOptimize(values.data());
  }
  const auto samples = static_cast<std::int64_t>(c.ultrasound.brightness.size() * poses.size());
  finish_samples(state, samples);
}

SimulationOptions nearest() {
  SimulationOptions options;
  options.interpolation = Interpolation::kNearest;
  return options;
}

SimulationOptions intensity() {
  SimulationOptions options;
  options.log_compression = LogCompression::kIntensity;
  return options;
}

SimulationOptions windowed_with_thresholds() {
  SimulationOptions options;
  options.window = HuWindow{};
  options.occlusion.by_threshold = true;
  return options;
}

BENCHMARK_CAPTURE(reference, trilinear, Interpolation::kTrilinear)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(reference, nearest, Interpolation::kNearest)->Unit(benchmark::kMillisecond);
BENCHMARK(generation)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fused, avx2_trilinear, HWY_AVX2, {})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fused, avx2_intensity, HWY_AVX2, intensity())->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fused, avx2_nearest, HWY_AVX2, nearest())->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fused, avx2_thresholds, HWY_AVX2, windowed_with_thresholds())
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fused, avx512_trilinear, HWY_AVX3, {})->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fused, avx512_intensity, HWY_AVX3, intensity())->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fused, avx512_nearest, HWY_AVX3, nearest())->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(fused, avx512_thresholds, HWY_AVX3, windowed_with_thresholds())
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace usct
