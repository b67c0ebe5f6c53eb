#pragma once

#include <memory>
#include <vector>

#include "core/rendering/simple_surfaces.h"
#include "us_ct_registration/rendering/overlay.h"

namespace usct::bench {

/// A kidney of 60 mm x 30 mm, a tumour, and three vessels, 50,000 triangles in all, 100 mm before
/// the camera: the kidney covers about a third of the image.
inline std::vector<OverlayStructure> kidney_scene() {
  const auto structure = [](const Eigen::Vector3d& centre_mm, const Eigen::Vector3d& radii_mm,
                            int rings, const Picture::Colour& colour) {
    OverlayStructure one;
    one.surface = std::make_shared<const Surface>(test::ellipsoid(centre_mm, radii_mm, rings));
    one.colour = colour;
    return one;
  };
  std::vector<OverlayStructure> structures{
      structure({0, 0, 100}, {50, 25, 20}, 73, {200, 80, 60}),
      structure({20, 5, 95}, {12, 12, 12}, 50, {60, 200, 80}),
      structure({-10, 0, 105}, {35, 3, 3}, 50, {220, 30, 30}),
      structure({-10, 10, 105}, {35, 4, 4}, 40, {40, 60, 220}),
      structure({-20, -10, 105}, {30, 2, 2}, 30, {220, 200, 60})};
  structures[1].bound_mm = 3.0;
  structures[1].bound_px = 1.0;
  return structures;
}

inline CameraIntrinsics full_hd(bool is_distorted) {
  CameraIntrinsics intrinsics;
  intrinsics.width = 1920;
  intrinsics.height = 1080;
  intrinsics.fx = intrinsics.fy = 1500.0;
  intrinsics.cx = 959.5;
  intrinsics.cy = 539.5;
  if (is_distorted) intrinsics.distortion = {-0.3, 0.09, 0.001, -0.001, 0.0, 0.0, 0.0, 0.0};
  return intrinsics;
}

}  // namespace usct::bench
