#include "finish.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/ultrasound/compounding.h"
#include "us_ct_registration/ultrasound/scan_conversion.h"

namespace usct {
namespace {

/// A sweep of 128 x 154 x 81, the size of the thesis' fifth phantom.
PreScanVolume motorised_sweep() {
  PreScanVolume prescan;
  prescan.geometry.axial = {128, 2.0, 0.6};
  prescan.geometry.array = CurvilinearArray{40.0, centred_table(154, 0.5 * kDegree)};
  prescan.geometry.motion = MotorSweep{27.25, centred_table(81, 0.7317 * kDegree), 0.0};
  prescan.voxels.resize(128U * 154U * 81U);
  for (std::size_t i = 0; i < prescan.voxels.size(); ++i)
    prescan.voxels[i] = static_cast<std::uint8_t>(i * 2654435761U >> 24);
  return prescan;
}

TrackedSweep tracked_sweep(int frames) {
  TrackedSweep sweep;
  for (int frame = 0; frame < frames; ++frame) {
    Eigen::Isometry3d T(Eigen::AngleAxisd(0.003 * frame, Eigen::Vector3d(1, 0.5, 0).normalized()));
    T.translation().z() = 0.6 * frame;
    sweep.T_us_frame.push_back(T);
  }
  return sweep;
}

/// Argument: grid spacing in hundredths of a millimetre.
void scan_convert_motorised(benchmark::State& state) {
  const PreScanVolume prescan = motorised_sweep();
  const Grid grid = fan_grid(prescan.geometry, 0.01 * static_cast<double>(state.range(0)));
  for (auto _ : state)
    benchmark::DoNotOptimize(scan_convert(prescan, grid, Interpolation::kTrilinear));
  finish(state, static_cast<std::int64_t>(grid.voxel_count()));
}
BENCHMARK(scan_convert_motorised)->Arg(100)->Arg(50)->Unit(benchmark::kMillisecond)->UseRealTime();

void scan_convert_oblique(benchmark::State& state) {
  const PreScanVolume prescan = motorised_sweep();
  Grid grid = fan_grid(prescan.geometry, 1.0);
  const Eigen::Vector3d centre = grid.centre_mm();
  grid.direction = Eigen::AngleAxisd(0.1, Eigen::Vector3d(1, 1, 1).normalized()).matrix();
  grid.origin_mm += centre - grid.centre_mm();
  for (auto _ : state)
    benchmark::DoNotOptimize(scan_convert(prescan, grid, Interpolation::kTrilinear));
  finish(state, static_cast<std::int64_t>(grid.voxel_count()));
}
BENCHMARK(scan_convert_oblique)->Unit(benchmark::kMillisecond)->UseRealTime();

/// The thesis' inverse scan conversion: a CT of 320 x 220 x 110 along the beams.
void inverse_scan_convert(benchmark::State& state) {
  const PreScanVolume prescan = motorised_sweep();
  const BeamGrid beams = beam_grid(prescan.geometry);
  Grid grid;
  grid.size = {320, 220, 110};
  grid.spacing_mm = {0.468, 0.468, 1.0};
  grid.origin_mm =
      Eigen::Vector3d(0, 80, 0) - 0.5 * grid.size.cast<double>().cwiseProduct(grid.spacing_mm);
  const CtVolume ct(grid, 40);
  for (auto _ : state)
    benchmark::DoNotOptimize(sample_along_beams(ct, beams, Eigen::Isometry3d::Identity(),
                                                Interpolation::kTrilinear,
                                                Outside::constant(0.0F)));
  finish(state, static_cast<std::int64_t>(prescan.voxels.size()));
}
BENCHMARK(inverse_scan_convert)->Unit(benchmark::kMillisecond)->UseRealTime();

/// Argument: radius of hole filling in millimetres.
void compound_tracked_fan(benchmark::State& state) {
  PreScanVolume prescan = motorised_sweep();
  prescan.geometry.motion = tracked_sweep(81);
  const Grid grid = fan_grid(prescan.geometry, 0.5);
  CompoundOptions options;
  options.hole_fill_radius_mm = static_cast<double>(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(compound(prescan, grid, options));
  finish(state, static_cast<std::int64_t>(grid.voxel_count()));
}
BENCHMARK(compound_tracked_fan)->Arg(0)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

/// 140 images of 739 x 593 pixels, as a human liver sweep; 0.5 mm voxels.
void compound_images(benchmark::State& state) {
  TrackedImages images;
  images.width = 739;
  images.height = 593;
  for (const Eigen::Isometry3d& pose : tracked_sweep(140).T_us_frame) {
    Eigen::Affine3d T(pose);
    T.linear() *= 0.3148;
    images.T_us_pixel.push_back(T);
  }
  images.pixels.assign(739U * 593U * 140U, 100);
  const Grid grid = image_grid(images, 0.5);
  for (auto _ : state) benchmark::DoNotOptimize(compound(images, grid, {}));
  finish(state, static_cast<std::int64_t>(grid.voxel_count()));
}
BENCHMARK(compound_images)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace usct
