#include "us_ct_registration/rendering/slices.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct {
namespace {

const Picture::Colour kOutside(12, 16, 40);

template <typename ColourAt>
Picture render(const SlicePlane& plane, const ColourAt& colour_at) {
  Picture picture(plane.width, plane.height);
  parallel_for(plane.height, [&](int y) {
    for (int x = 0; x < plane.width; ++x) {
      const Picture::Colour colour = colour_at(plane.point_mm(x, y));
      std::copy_n(colour.data(), 3, picture.pixel(x, y));
    }
  });
  return picture;
}

Picture::Colour grey(double brightness) {
  return Picture::Colour::Constant(
      static_cast<std::uint8_t>(std::clamp(std::nearbyint(brightness), 0.0, 255.0)));
}

bool is_outside(const std::uint8_t* pixel) { return std::equal(pixel, pixel + 3, kOutside.data()); }

void require_same_size(const Picture& us, const Picture& ct) {
  if (us.width != ct.width || us.height != ct.height)
    throw InputError("picture", "ultrasound is " + std::to_string(us.width) + " x " +
                                    std::to_string(us.height) + " and CT " +
                                    std::to_string(ct.width) + " x " + std::to_string(ct.height) +
                                    " pixels, must be equal");
}

}  // namespace

std::array<SlicePlane, 3> orthogonal_planes(const Grid& extent, const Eigen::Vector3d& centre_mm,
                                            double pixel_mm) {
  // Size of the extent's bounding box along the axes of the US frame.
  const Eigen::Vector3d size_mm =
      (extent.direction.cwiseAbs() * extent.spacing_mm.cwiseProduct(extent.size.cast<double>()));
  const Eigen::Vector3d box_centre_mm = extent.centre_mm();
  const auto plane = [&](const char* name, int right, int down, int normal) {
    SlicePlane p;
    p.name = name;
    p.centre_mm = box_centre_mm;
    p.centre_mm[normal] = centre_mm[normal];
    p.right = Eigen::Vector3d::Unit(right);
    p.down = Eigen::Vector3d::Unit(down);
    p.pixel_mm = pixel_mm;
    p.width = std::max(1, static_cast<int>(std::lround(size_mm[right] / pixel_mm)));
    p.height = std::max(1, static_cast<int>(std::lround(size_mm[down] / pixel_mm)));
    return p;
  };
  return {plane("lateral / axial", 0, 1, 2), plane("elevation / axial", 2, 1, 0),
          plane("lateral / elevation", 0, 2, 1)};
}

Picture render_us(const UsVolume& us, const MaskVolume& mask, const SlicePlane& plane) {
  return render(plane, [&](const Eigen::Vector3d& p_us) -> Picture::Colour {
    if (sample(mask, p_us, Interpolation::kNearest, Outside::constant(0)) == 0.0F) return kOutside;
    return grey(sample(us, p_us, Interpolation::kTrilinear, Outside::edge()));
  });
}

Picture render_ct(const CtVolume& ct, const Eigen::Isometry3d& T_us_ct, CtWindow window,
                  const SlicePlane& plane) {
  const Eigen::Isometry3d T_ct_us = T_us_ct.inverse();
  return render(plane, [&](const Eigen::Vector3d& p_us) -> Picture::Colour {
    const Eigen::Vector3d index = ct.grid.index_from_physical(T_ct_us * p_us);
    if (!contains_index(ct.grid, index)) return kOutside;
    const double hu = sample_at_index(ct, index, Interpolation::kTrilinear, Outside::edge());
    return grey(255.0 * (hu - window.low_hu) / (window.high_hu - window.low_hu));
  });
}

Picture blend(const Picture& us, const Picture& ct) {
  require_same_size(us, ct);
  Picture result(us.width, us.height);
  for (int y = 0; y < us.height; ++y)
    for (int x = 0; x < us.width; ++x) {
      const std::uint8_t* u = us.pixel(x, y);
      const std::uint8_t* c = ct.pixel(x, y);
      const int ultrasound = is_outside(u) ? 0 : u[0];
      const int computed = is_outside(c) ? 0 : c[0];
      std::uint8_t* pixel = result.pixel(x, y);
      pixel[0] = static_cast<std::uint8_t>(computed);
      pixel[1] = static_cast<std::uint8_t>((ultrasound + computed) / 2);
      pixel[2] = static_cast<std::uint8_t>(ultrasound);
    }
  return result;
}

void draw_points(Picture& picture, const SlicePlane& plane,
                 const std::vector<Eigen::Vector3d>& points_mm, double distance_mm,
                 const Picture::Colour& colour) {
  const Eigen::Vector3d normal = plane.right.cross(plane.down);
  for (const Eigen::Vector3d& p_mm : points_mm) {
    const Eigen::Vector3d offset_mm = p_mm - plane.centre_mm;
    if (!(std::abs(normal.dot(offset_mm)) <= distance_mm)) continue;
    const double x = plane.right.dot(offset_mm) / plane.pixel_mm + 0.5 * (plane.width - 1);
    const double y = plane.down.dot(offset_mm) / plane.pixel_mm + 0.5 * (plane.height - 1);
    // The test also rejects coordinates that exceed the range of int.
    if (!(x > 0.5 && y > 0.5 && x < plane.width - 1.5 && y < plane.height - 1.5)) continue;
    for (int dy = -1; dy <= 1; ++dy)
      for (int dx = -1; dx <= 1; ++dx)
        std::copy_n(colour.data(), 3,
                    picture.pixel(static_cast<int>(std::lround(x)) + dx,
                                  static_cast<int>(std::lround(y)) + dy));
  }
}

Picture checkerboard(const Picture& us, const Picture& ct, int squares_across) {
  require_same_size(us, ct);
  if (squares_across < 1)
    throw InputError("checkerboard",
                     std::to_string(squares_across) + " squares side by side, must be >= 1");
  // The size is rounded up, so that no strip remains.
  const int square_px = std::max(1, (us.width + squares_across - 1) / squares_across);
  Picture result = us;
  for (int y = 0; y < us.height; ++y)
    for (int x = 0; x < us.width; ++x)
      if ((x / square_px + y / square_px) % 2 == 1)
        std::copy_n(ct.pixel(x, y), 3, result.pixel(x, y));
  return result;
}

}  // namespace usct
