#include "us_ct_registration/rendering/registration_pictures.h"

#include <algorithm>
#include <cmath>

#include "rendering/panel_marks.h"
#include "rendering/registration_panels.h"
#include "require.h"
#include "us_ct_registration/geometry/rigid.h"
#include "us_ct_registration/rendering/result_marks.h"

namespace usct {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using rendering::Panels;

constexpr const char* kFusion = "fusion.png";
constexpr const char* kSlices = "slices.png";
constexpr int kLegendPx = 24;
constexpr int kCaptionPx = 16;
constexpr int kParallelSlices = 5;
/// Parallel slices leave out the ends of the field, where there is little to compare.
constexpr double kFirstSlice = 0.2;

Isometry3d required_pose(const RegistrationResult& result) {
  const std::optional<Isometry3d> T_us_ct = drawn_pose(result);
  if (!T_us_ct) throw InputError("result", "has neither a transform nor a candidate to draw");
  return *T_us_ct;
}

using Row = std::vector<Picture>;

void caption(Picture& picture, const std::string& text) {
  draw_text(picture, text, rendering::kMarginPx, kCaptionPx);
}

/// The panels below a header with the result in words and the legend.
Picture sheet(const std::vector<Row>& rows, const Panels& panels,
              const RegistrationResult& result) {
  const Picture body = tile(rows);
  Picture legend(body.width, kLegendPx);
  panels.draw_legend(legend, rendering::kMarginPx, kLegendPx - rendering::kMarginPx);
  return tile({{result_header(result, body.width)}, {legend}, {body}});
}

Picture before_after_sheet(const Panels& panels, const Isometry3d& T_us_ct_before,
                           const RegistrationResult& result) {
  const std::optional<Isometry3d> T_us_ct_after = drawn_pose(result);
  std::vector<Row> rows(T_us_ct_after ? 3 : 2);
  for (const SlicePlane& plane : panels.planes()) {
    rows[0].push_back(panels.ultrasound(plane));
    caption(rows[0].back(), plane.name);
    rows[1].push_back(panels.overlay(plane, T_us_ct_before));
    caption(rows[1].back(), "before (start)");
    if (!T_us_ct_after) continue;
    rows[2].push_back(panels.overlay(plane, *T_us_ct_after));
    caption(rows[2].back(), is_refused(result) ? "best candidate" : "after (registered)");
  }
  if (T_us_ct_after) mark_if_refused(rows[2], result);
  return sheet(rows, panels, result);
}

Picture fusion_sheet(const Panels& panels, const Isometry3d& T_us_ct,
                     const RegistrationResult& result) {
  std::vector<Row> rows;
  for (const SlicePlane& plane : panels.planes()) {
    const Picture ultrasound = panels.ultrasound(plane);
    const Picture computed = panels.computed(plane, T_us_ct);
    Row row{panels.overlay(plane, T_us_ct), panels.with_contours(computed, plane, T_us_ct),
            blend(ultrasound, computed), checkerboard(ultrasound, computed)};
    const char* kinds[] = {"US, CT's lines", "CT", "US blue, CT orange", "US and CT"};
    for (std::size_t i = 0; i < row.size(); ++i) caption(row[i], plane.name + ": " + kinds[i]);
    mark_if_refused(row, result);
    rows.push_back(std::move(row));
  }
  return sheet(rows, panels, result);
}

Picture parallel_sheet(const Panels& panels, const Isometry3d& T_us_ct,
                       const RegistrationResult& result) {
  std::vector<Row> rows;
  for (const SlicePlane& middle : panels.planes()) {
    Row row;
    for (int i = 0; i < kParallelSlices; ++i) {
      const double step = (1.0 - 2.0 * kFirstSlice) / (kParallelSlices - 1);
      double at_mm = 0.0;
      const SlicePlane plane = panels.parallel(middle, kFirstSlice + i * step, at_mm);
      row.push_back(panels.overlay(plane, T_us_ct));
      caption(row.back(), plane.name + " at " + std::to_string(std::lround(at_mm)) + " mm");
    }
    mark_if_refused(row, result);
    rows.push_back(std::move(row));
  }
  return sheet(rows, panels, result);
}

}  // namespace

void RegistrationPictureOptions::validate(const std::string& source) const {
  require_positive(source, "pixel_mm", pixel_mm);
  require_not_negative(source, "smoothing_mm", smoothing_mm);
  require_not_negative(source, "least_length_mm", least_length_mm);
  require(window.low_hu < window.high_hu, source, "window.high_hu", window.high_hu,
          "> window.low_hu");
  for (const ContourLevel& level : levels)
    require(std::isfinite(level.hu), source, "levels.hu", level.hu, "finite");
  if (centre_us_mm)
    for (const double coordinate : *centre_us_mm)
      require(std::isfinite(coordinate), source, "centre_us_mm", coordinate, "finite");
  require_rotation(axes_us, source, "axes_us", 1e-4);
}

Eigen::Matrix3d picture_axes(const Ultrasound& ultrasound) {
  if (const auto* prescan = std::get_if<PreScanVolume>(&ultrasound))
    if (const auto* sweep = std::get_if<TrackedSweep>(&prescan->geometry.motion))
      return sweep->T_us_frame[sweep->T_us_frame.size() / 2].linear();
  if (const auto* images = std::get_if<TrackedImages>(&ultrasound)) {
    const Eigen::Affine3d& T_us_pixel = images->T_us_pixel[images->T_us_pixel.size() / 2];
    Eigen::Matrix3d axes;
    axes.col(0) = T_us_pixel.linear().col(0).normalized();
    axes.col(2) = axes.col(0).cross(T_us_pixel.linear().col(1)).normalized();
    axes.col(1) = axes.col(2).cross(axes.col(0));
    return axes;
  }
  return Eigen::Matrix3d::Identity();
}

Picture picture_registration(const ScanConverted& us, const CtVolume& ct,
                             const Isometry3d& T_us_ct_before, const RegistrationResult& result,
                             const RegistrationPictureOptions& options) {
  const Panels panels(us, ct, drawn_pose(result).value_or(T_us_ct_before), options);
  return before_after_sheet(panels, T_us_ct_before, result);
}

Picture picture_fusion(const ScanConverted& us, const CtVolume& ct,
                       const RegistrationResult& result,
                       const RegistrationPictureOptions& options) {
  const Isometry3d T_us_ct = required_pose(result);
  return fusion_sheet(Panels(us, ct, T_us_ct, options), T_us_ct, result);
}

Picture picture_parallel_slices(const ScanConverted& us, const CtVolume& ct,
                                const RegistrationResult& result,
                                const RegistrationPictureOptions& options) {
  const Isometry3d T_us_ct = required_pose(result);
  return parallel_sheet(Panels(us, ct, T_us_ct, options), T_us_ct, result);
}

std::vector<std::filesystem::path> write_registration_pictures(
    const ScanConverted& us, const CtVolume& ct, const Isometry3d& T_us_ct_before,
    const RegistrationResult& result, const std::filesystem::path& folder,
    const RegistrationPictureOptions& options) {
  const std::optional<Isometry3d> T_us_ct_after = drawn_pose(result);
  const Panels panels(us, ct, T_us_ct_after.value_or(T_us_ct_before), options);
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (failure) throw InputError(folder.string(), "cannot be created: " + failure.message());
  std::vector<std::filesystem::path> paths;
  const auto write = [&](const char* name, const Picture& picture) {
    paths.push_back(folder / name);
    write_png(picture, paths.back());
  };
  write("before_after.png", before_after_sheet(panels, T_us_ct_before, result));
  if (!T_us_ct_after) {
    // Pictures of an earlier registration would stand beside it, as if they belonged to this one.
    for (const char* name : {kFusion, kSlices})
      if (std::filesystem::is_regular_file(folder / name)) std::filesystem::remove(folder / name);
    return paths;
  }
  write(kFusion, fusion_sheet(panels, *T_us_ct_after, result));
  write(kSlices, parallel_sheet(panels, *T_us_ct_after, result));
  return paths;
}

}  // namespace usct
