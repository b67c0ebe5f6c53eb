#pragma once

#include <cmath>
#include <cstdint>

#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/rendering/surface.h"

namespace usct::test {

/// A closed ellipsoid of `rings` x `2 rings` facets, triangles anticlockwise as seen from outside.
inline Surface ellipsoid(const Eigen::Vector3d& centre_mm, const Eigen::Vector3d& radii_mm,
                         int rings) {
  Surface surface;
  const int columns = 2 * rings;
  for (int i = 0; i <= rings; ++i)
    for (int j = 0; j < columns; ++j) {
      const double polar = kPi * i / rings;
      const double azimuth = 2.0 * kPi * j / columns;
      surface.points_mm.emplace_back(
          centre_mm + radii_mm.cwiseProduct(Eigen::Vector3d(std::sin(polar) * std::cos(azimuth),
                                                            std::sin(polar) * std::sin(azimuth),
                                                            std::cos(polar))));
    }
  const auto at = [&](int i, int j) {
    return static_cast<std::uint32_t>(i * columns + j % columns);
  };
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < columns; ++j) {
      surface.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      surface.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return surface;
}

inline Surface ball(const Eigen::Vector3d& centre_mm, double radius_mm, int rings) {
  return ellipsoid(centre_mm, Eigen::Vector3d::Constant(radius_mm), rings);
}

/// A rectangle in the plane z = `depth_mm`, of two triangles that face the origin.
inline Surface rectangle(double half_width_mm, double half_height_mm, double depth_mm) {
  Surface surface;
  surface.points_mm = {{-half_width_mm, -half_height_mm, depth_mm},
                       {half_width_mm, -half_height_mm, depth_mm},
                       {half_width_mm, half_height_mm, depth_mm},
                       {-half_width_mm, half_height_mm, depth_mm}};
  surface.triangles = {{0, 2, 1}, {0, 3, 2}};
  return surface;
}

}  // namespace usct::test
