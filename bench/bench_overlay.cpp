#include "finish.h"
#include "overlay_scene.h"

namespace usct {
namespace {

/// 50,000 triangles into an image of 1920 x 1080, on one thread; the argument says whether the lens
/// distorts. Items are images.
void draw_overlay(benchmark::State& state) {
  const Camera camera(bench::full_hd(state.range(0) != 0), "bench");
  const std::vector<OverlayStructure> structures = bench::kidney_scene();
  std::size_t triangles = 0;
  for (const OverlayStructure& one : structures) triangles += one.surface->triangles.size();
  Picture picture(1920, 1080);
  OverlayRenderer renderer;
  Eigen::Isometry3d T_camera_ct = Eigen::Isometry3d::Identity();
  double shift_mm = 0.0;
  for (auto _ : state) {
    T_camera_ct.translation().x() = 5.0 * std::sin(shift_mm += 0.1);
    benchmark::DoNotOptimize(
        renderer.draw(view_of(picture), camera, T_camera_ct, structures).data());
  }
  finish(state, 1);
  state.counters["triangles"] = static_cast<double>(triangles);
}
BENCHMARK(draw_overlay)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace usct
