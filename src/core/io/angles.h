#pragma once

#include <vector>

/// Files are in degrees, the core in radians: the conversion stands here, once.
namespace usct::io {

constexpr double kRadiansPerDegree = 3.14159265358979323846 / 180.0;

constexpr double radians(double degrees) { return degrees * kRadiansPerDegree; }
constexpr double degrees(double radians) { return radians / kRadiansPerDegree; }

inline std::vector<double> radians(std::vector<double> values) {
  for (double& value : values) value = radians(value);
  return values;
}
inline std::vector<double> degrees(std::vector<double> values) {
  for (double& value : values) value = degrees(value);
  return values;
}

}  // namespace usct::io
