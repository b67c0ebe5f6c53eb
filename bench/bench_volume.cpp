#include "finish.h"
#include "us_ct_registration/volume/operations.h"

namespace usct {
namespace {

CtVolume diagnostic_ct() {
  Grid grid;
  grid.size = {512, 512, 300};
  grid.spacing_mm = {0.7, 0.7, 1.0};
  CtVolume ct(grid);
  for (std::size_t i = 0; i < ct.voxels.size(); ++i)
    ct.voxels[i] = static_cast<std::int16_t>(i % 997);
  return ct;
}

/// The region that the ultrasound can reach, a cube of about 150 mm.
Region kidney_region() { return {{150, 150, 80}, {214, 214, 150}}; }

void count_voxels(benchmark::State& state, const Region& region) {
  finish(state, region.size.cast<std::int64_t>().prod());
}

void pyramid_whole(benchmark::State& state) {
  const CtVolume ct = diagnostic_ct();
  for (auto _ : state)
    benchmark::DoNotOptimize(pyramid(ct, {{8, 8, 5}, {4, 4, 3}, {2, 2, 1}}, whole(ct.grid)));
  count_voxels(state, whole(ct.grid));
}
BENCHMARK(pyramid_whole)->Unit(benchmark::kMillisecond)->UseRealTime();

void pyramid_of_region(benchmark::State& state) {
  const CtVolume ct = diagnostic_ct();
  for (auto _ : state)
    benchmark::DoNotOptimize(pyramid(ct, {{8, 8, 5}, {4, 4, 3}, {2, 2, 1}}, kidney_region()));
  count_voxels(state, kidney_region());
}
BENCHMARK(pyramid_of_region)->Unit(benchmark::kMillisecond)->UseRealTime();

void smooth_of_region(benchmark::State& state) {
  const CtVolume ct = diagnostic_ct();
  for (auto _ : state)
    benchmark::DoNotOptimize(smooth_gaussian(ct, Eigen::Vector3d::Constant(1.0), kidney_region()));
  count_voxels(state, kidney_region());
}
BENCHMARK(smooth_of_region)->Unit(benchmark::kMillisecond)->UseRealTime();

void resample_trilinear(benchmark::State& state) {
  const CtVolume ct = diagnostic_ct();
  Grid target;
  target.size = {150, 150, 150};
  target.origin_mm = {100, 100, 80};
  Eigen::Isometry3d T_ct_target = Eigen::Isometry3d::Identity();
  T_ct_target.linear() =
      Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  for (auto _ : state)
    benchmark::DoNotOptimize(
        resample(ct, target, T_ct_target, Interpolation::kTrilinear, Outside::constant(-1000)));
  count_voxels(state, whole(target));
}
BENCHMARK(resample_trilinear)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace usct
