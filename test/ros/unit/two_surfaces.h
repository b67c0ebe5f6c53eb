#pragma once

#include <map>

#include "us_ct_registration/rendering/surface.h"

namespace usct::ros_interface {

/// Label 2 has two triangles that face each other, label 5 the first of them.
inline std::map<int, Surface> two_surfaces() {
  Surface triangle;
  triangle.points_mm = {{0, 0, 0}, {1000, 0, 0}, {0, 2000, -500}};
  triangle.triangles = {{0, 1, 2}, {2, 1, 0}};
  Surface other = triangle;
  other.triangles.pop_back();
  return {{2, triangle}, {5, other}};
}

}  // namespace usct::ros_interface
