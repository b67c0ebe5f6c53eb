#include "us_ct_registration/rendering/registration_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "rendering/ct_contours.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

const Picture::Colour kRefusedColour(225, 0, 0);
const Picture::Colour kHeaderColour(30, 30, 30);
constexpr int kMarginPx = 6;
constexpr int kLinePx = 24;
constexpr int kCaptionPx = 16;
constexpr int kFrameWidthPx = 3;
constexpr int kParallelSlices = 5;
/// Parallel slices leave out the ends of the field, where there is little to judge by.
constexpr double kFirstSlice = 0.2;

/// A factor on brightness that makes the brightest percent white, so that weak ultrasound shows.
double display_gain(const ScanConverted& us) {
  constexpr double kLargestGain = 4.0;
  std::array<std::size_t, 256> histogram{};
  std::size_t known = 0;
  for (std::size_t i = 0; i < us.volume.voxels.size(); ++i)
    if (us.mask.voxels[i] != 0) {
      ++histogram[us.volume.voxels[i]];
      ++known;
    }
  int brightness = 255;
  for (std::size_t above = 0; brightness > 1; --brightness) {
    above += histogram[static_cast<std::size_t>(brightness)];
    if (100 * above >= known) break;
  }
  return std::min(kLargestGain, 255.0 / brightness);
}

/// What the ultrasound knows, along the axes of the pictures: its middle, and a box around it.
struct Field {
  Vector3d middle_mm = Vector3d::Zero();
  Eigen::AlignedBox3d box_mm;
};

Field field_along(const Eigen::Matrix3d& axes_us, const MaskVolume& mask) {
  const Eigen::Affine3d T_axes_index = axes_us.transpose() * mask.grid.T_physical_index();
  Field field;
  double known = 0.0;
  for (int k = 0; k < mask.grid.size.z(); ++k)
    for (int j = 0; j < mask.grid.size.y(); ++j)
      for (int i = 0; i < mask.grid.size.x(); ++i)
        if (mask.at(i, j, k) != 0) {
          const Vector3d p = T_axes_index * Vector3d(i, j, k);
          field.box_mm.extend(p);
          field.middle_mm += p;
          known += 1.0;
        }
  if (known == 0.0) throw InputError("ultrasound", "its mask is empty, must know something");
  field.middle_mm /= known;
  return field;
}

/// As `orthogonal_planes`, along other axes.
std::array<SlicePlane, 3> planes_along(const Eigen::Matrix3d& axes_us, const Field& field,
                                       const RegistrationPictureOptions& options) {
  const Vector3d centre_mm = options.centre_us_mm
                                 ? Vector3d(axes_us.transpose() * *options.centre_us_mm)
                                 : field.middle_mm;
  const Grid extent = grid_around_box(field.box_mm.min(), field.box_mm.max(), options.pixel_mm);
  std::array<SlicePlane, 3> planes = orthogonal_planes(extent, centre_mm, options.pixel_mm);
  for (SlicePlane& plane : planes) {
    plane.centre_mm = axes_us * plane.centre_mm;
    plane.right = axes_us * plane.right;
    plane.down = axes_us * plane.down;
  }
  return planes;
}

/// What a registration leaves to draw: its transform, or the best that it refused.
std::optional<Isometry3d> pose_after(const RegistrationResult& result) {
  if (result.T_us_ct) return result.T_us_ct;
  if (!result.candidates.empty()) return result.candidates.front().T_us_ct;
  return std::nullopt;
}

Isometry3d required_pose(const RegistrationResult& result) {
  const std::optional<Isometry3d> T_us_ct = pose_after(result);
  if (!T_us_ct) throw InputError("result", "has neither a transform nor a candidate to draw");
  return *T_us_ct;
}

bool is_refused(const RegistrationResult& result) { return !result.T_us_ct.has_value(); }

int text_width_px(const std::string& text) {
  int baseline = 0;
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, 0.45, 1, &baseline).width;
}

/// Ultrasound is grey, its surroundings dark blue.
bool is_unknown(const std::uint8_t* pixel) { return pixel[0] != pixel[2]; }

/// Draws the panels of one registration, all with the same levels and brightness.
class Panels {
 public:
  Panels(const ScanConverted& us, const CtVolume& ct, const Isometry3d& T_us_ct_of_levels,
         const RegistrationPictureOptions& options)
      : us_(us), ct_(ct), options_(options), gain_(display_gain(us)) {
    options.validate("registration pictures");
    field_ = field_along(options.axes_us, us.mask);
    planes_ = planes_along(options.axes_us, field_, options);
    if (options.levels.empty())
      options_.levels =
          rendering::choose_levels(ct, T_us_ct_of_levels, us.mask, planes_, options.smoothing_mm);
  }

  const std::array<SlicePlane, 3>& planes() const { return planes_; }

  /// Parallel to `plane`, a fraction of the field's extent from its start; `at_mm` along the
  /// normal.
  SlicePlane parallel(SlicePlane plane, double fraction, double& at_mm) const {
    const Vector3d normal = plane.right.cross(plane.down);
    const Vector3d along = (options_.axes_us.transpose() * normal).cwiseAbs();
    at_mm = along.dot(field_.box_mm.min() + fraction * field_.box_mm.sizes());
    const Vector3d axis = options_.axes_us * along;
    plane.centre_mm += (at_mm - axis.dot(plane.centre_mm)) * axis;
    return plane;
  }

  Picture ultrasound(const SlicePlane& plane) const {
    Picture picture = render_us(us_.volume, us_.mask, plane);
    for (std::size_t i = 0; i < picture.pixels.size(); i += 3) {
      std::uint8_t* pixel = &picture.pixels[i];
      if (is_unknown(pixel)) continue;
      std::fill_n(pixel, 3, static_cast<std::uint8_t>(std::min(255.0, gain_ * pixel[0])));
    }
    return picture;
  }

  Picture computed(const SlicePlane& plane, const Isometry3d& T_us_ct) const {
    return render_ct(ct_, T_us_ct, options_.window, plane);
  }

  Picture with_contours(Picture picture, const SlicePlane& plane, const Isometry3d& T_us_ct) const {
    rendering::draw_contours(picture, ct_, T_us_ct, plane, options_);
    return picture;
  }

  /// Lines fade where there is no ultrasound to judge them by.
  Picture overlay(const SlicePlane& plane, const Isometry3d& T_us_ct) const {
    const Picture alone = ultrasound(plane);
    Picture picture = with_contours(alone, plane, T_us_ct);
    for (std::size_t i = 0; i < picture.pixels.size(); ++i)
      if (is_unknown(&alone.pixels[i - i % 3]))
        picture.pixels[i] =
            static_cast<std::uint8_t>((picture.pixels[i] + 2 * alone.pixels[i]) / 3);
    return picture;
  }

  /// The names of the levels in their colours.
  void draw_legend(Picture& header, int x, int y) const {
    for (const ContourLevel& level : options_.levels) {
      std::ostringstream text;
      text << "-- " << level.name << " (" << std::lround(level.hu) << " HU)";
      draw_text(header, text.str(), x, y, level.colour);
      x += text_width_px(text.str()) + 3 * kMarginPx;
    }
  }

 private:
  const ScanConverted& us_;
  const CtVolume& ct_;
  RegistrationPictureOptions options_;
  double gain_;
  Field field_;
  std::array<SlicePlane, 3> planes_;
};

using Row = std::vector<Picture>;

void caption(Picture& picture, const std::string& text) {
  draw_text(picture, text, kMarginPx, kCaptionPx);
}

void fill(Picture& picture, int left, int top, int width, int height,
          const Picture::Colour& colour) {
  for (int y = top; y < top + height; ++y)
    for (int x = left; x < left + width; ++x) std::copy_n(colour.data(), 3, picture.pixel(x, y));
}

/// A red frame around each panel of a pose that was refused.
void mark_if_refused(Row& row, const RegistrationResult& result) {
  if (!is_refused(result)) return;
  for (Picture& picture : row) {
    const int px = std::min({kFrameWidthPx, picture.width, picture.height});
    fill(picture, 0, 0, picture.width, px, kRefusedColour);
    fill(picture, 0, picture.height - px, picture.width, px, kRefusedColour);
    fill(picture, 0, 0, px, picture.height, kRefusedColour);
    fill(picture, picture.width - px, 0, px, picture.height, kRefusedColour);
    draw_text(picture, "REFUSED", kMarginPx, picture.height - 2 * kMarginPx, kRefusedColour);
  }
}

std::string headline(const RegistrationResult& result) {
  std::ostringstream text;
  text.precision(3);
  if (is_refused(result))
    text << "REFUSED (" << status_name(result.status) << "), "
         << (result.candidates.empty() ? "no candidate to draw"
                                       : "drawn: the best candidate, NOT a registration");
  else
    text << "registered";
  if (std::isfinite(result.similarity)) text << ", similarity " << result.similarity;
  if (std::isfinite(result.overlap)) text << ", overlap " << result.overlap;
  text << ". " << result.message;
  return text.str();
}

/// The panels below the result in words and the legend.
Picture sheet(const std::vector<Row>& rows, const Panels& panels,
              const RegistrationResult& result) {
  const Picture body = tile(rows);
  Picture header(body.width, 2 * kLinePx);
  fill(header, 0, 0, header.width, kLinePx, is_refused(result) ? kRefusedColour : kHeaderColour);
  fill(header, 0, kLinePx, header.width, kLinePx, kHeaderColour);
  draw_text(header, headline(result), kMarginPx, kLinePx - kMarginPx);
  panels.draw_legend(header, kMarginPx, 2 * kLinePx - kMarginPx);
  return tile({{header}, {body}});
}

Picture before_after_sheet(const Panels& panels, const Isometry3d& T_us_ct_before,
                           const RegistrationResult& result) {
  const std::optional<Isometry3d> T_us_ct_after = pose_after(result);
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
  const auto require = [&](bool valid, const char* field, double value, const char* constraint) {
    if (valid) return;
    std::ostringstream violation;
    violation << "'" << field << "' is " << value << ", must be " << constraint;
    throw InputError(source, violation.str());
  };
  require(std::isfinite(pixel_mm) && pixel_mm > 0.0, "pixel_mm", pixel_mm, "> 0");
  require(std::isfinite(smoothing_mm) && smoothing_mm >= 0.0, "smoothing_mm", smoothing_mm, ">= 0");
  require(std::isfinite(least_length_mm) && least_length_mm >= 0.0, "least_length_mm",
          least_length_mm, ">= 0");
  require(window.low_hu < window.high_hu, "window.high_hu", window.high_hu, "> window.low_hu");
  for (const ContourLevel& level : levels)
    require(std::isfinite(level.hu), "levels.hu", level.hu, "finite");
  if (centre_us_mm)
    for (const double coordinate : *centre_us_mm)
      require(std::isfinite(coordinate), "centre_us_mm", coordinate, "finite");
  const double skew = (axes_us.transpose() * axes_us - Eigen::Matrix3d::Identity()).norm();
  require(skew < 1e-4 && axes_us.determinant() > 0.0, "axes_us (determinant)",
          axes_us.determinant(), "a rotation");
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
  const Panels panels(us, ct, pose_after(result).value_or(T_us_ct_before), options);
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
  const std::optional<Isometry3d> T_us_ct_after = pose_after(result);
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
  if (!T_us_ct_after) return paths;
  write("fusion.png", fusion_sheet(panels, *T_us_ct_after, result));
  write("slices.png", parallel_sheet(panels, *T_us_ct_after, result));
  return paths;
}

}  // namespace usct
