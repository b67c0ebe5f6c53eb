#include "rendering/registration_panels.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "rendering/ct_contours.h"
#include "us_ct_registration/error.h"

namespace usct::rendering {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr int kLegendGapPx = 18;

/// A factor on brightness that makes the brightest percent white, so that weak ultrasound is
/// visible.
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

/// Planes through a point (US frame) as `orthogonal_planes`, but along `axes_us`.
std::array<SlicePlane, 3> planes_along(const Eigen::Matrix3d& axes_us, const Field& field,
                                       const Vector3d& centre_us_mm, double pixel_mm) {
  const Grid extent = grid_around_box(field.box_mm.min(), field.box_mm.max(), pixel_mm);
  std::array<SlicePlane, 3> planes =
      orthogonal_planes(extent, axes_us.transpose() * centre_us_mm, pixel_mm);
  for (SlicePlane& plane : planes) {
    plane.centre_mm = axes_us * plane.centre_mm;
    plane.right = axes_us * plane.right;
    plane.down = axes_us * plane.down;
  }
  return planes;
}

/// Whether a pixel is unknown: ultrasound is grey, its surroundings dark blue.
bool is_unknown(const std::uint8_t* pixel) { return pixel[0] != pixel[2]; }

}  // namespace

Panels::Panels(const ScanConverted& us, const RegistrationPictureOptions& options)
    : us_(us), options_(options), gain_(display_gain(us)) {
  options.validate("registration pictures");
  field_ = field_along(options.axes_us, us.mask);
  centre_us_mm_ = options.centre_us_mm.value_or(options.axes_us * field_.middle_mm);
  planes_ = planes_along(options.axes_us, field_, centre_us_mm_, options.pixel_mm);
}

Panels::Panels(const ScanConverted& us, const CtVolume& ct, const Isometry3d& T_us_ct_of_levels,
               const RegistrationPictureOptions& options)
    : Panels(us, options) {
  ct_ = &ct;
  if (options.levels.empty())
    options_.levels = choose_levels(ct, T_us_ct_of_levels, us.mask, planes_, options.smoothing_mm);
}

SlicePlane Panels::parallel(SlicePlane plane, double fraction, double& at_mm) const {
  const Vector3d normal = plane.right.cross(plane.down);
  const Vector3d along = (options_.axes_us.transpose() * normal).cwiseAbs();
  at_mm = along.dot(field_.box_mm.min() + fraction * field_.box_mm.sizes());
  const Vector3d axis = options_.axes_us * along;
  plane.centre_mm += (at_mm - axis.dot(plane.centre_mm)) * axis;
  return plane;
}

Picture Panels::ultrasound(const SlicePlane& plane) const {
  Picture picture = render_us(us_.volume, us_.mask, plane);
  for (std::size_t i = 0; i < picture.pixels.size(); i += 3) {
    std::uint8_t* pixel = &picture.pixels[i];
    if (is_unknown(pixel)) continue;
    std::fill_n(pixel, 3, static_cast<std::uint8_t>(std::min(255.0, gain_ * pixel[0])));
  }
  return picture;
}

Picture Panels::computed(const SlicePlane& plane, const Isometry3d& T_us_ct) const {
  return render_ct(*ct_, T_us_ct, options_.window, plane);
}

Picture Panels::with_contours(Picture picture, const SlicePlane& plane,
                              const Isometry3d& T_us_ct) const {
  draw_contours(picture, *ct_, T_us_ct, plane, options_);
  return picture;
}

Picture Panels::overlay(const SlicePlane& plane, const Isometry3d& T_us_ct) const {
  const Picture alone = ultrasound(plane);
  Picture picture = with_contours(alone, plane, T_us_ct);
  for (std::size_t i = 0; i < picture.pixels.size(); ++i)
    if (is_unknown(&alone.pixels[i - i % 3]))
      picture.pixels[i] = static_cast<std::uint8_t>((picture.pixels[i] + 2 * alone.pixels[i]) / 3);
  return picture;
}

void Panels::draw_legend(Picture& header, int x, int y) const {
  for (const ContourLevel& level : options_.levels) {
    std::ostringstream text;
    text << "-- " << level.name << " (" << std::lround(level.hu) << " HU)";
    draw_text(header, text.str(), x, y, level.colour);
    x += text_width_px(text.str()) + kLegendGapPx;
  }
}

}  // namespace usct::rendering
