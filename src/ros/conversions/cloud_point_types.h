#pragma once

#include <pcl/register_point_struct.h>

#include <cstdint>

/// Types of points for PCL's clouds, m. PCL's own PointXYZI and PointXYZL have 32 bytes with their
/// padding; these have 16, in a message as in memory.
namespace usct::ros_interface {

struct BrightPoint {
  float x, y, z, intensity;
};
struct LabelledPoint {
  float x, y, z;
  std::uint32_t label;
};

}  // namespace usct::ros_interface

POINT_CLOUD_REGISTER_POINT_STRUCT(usct::ros_interface::BrightPoint,
                                  (float, x, x)(float, y, y)(float, z, z)(float, intensity,
                                                                          intensity))
POINT_CLOUD_REGISTER_POINT_STRUCT(usct::ros_interface::LabelledPoint,
                                  (float, x, x)(float, y, y)(float, z, z)(std::uint32_t, label,
                                                                          label))
