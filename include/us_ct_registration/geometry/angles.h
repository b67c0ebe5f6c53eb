#pragma once

#include <vector>

/// The core holds angles in radians; files and user interfaces give them in degrees. All
/// conversions between the two use this header.
namespace usct {

constexpr double kPi = 3.14159265358979323846;
/// One degree, in radians.
constexpr double kDegree = kPi / 180.0;

constexpr double radians(double degrees) { return degrees * kDegree; }
constexpr double degrees(double radians) { return radians / kDegree; }

inline std::vector<double> radians(std::vector<double> values) {
  for (double& value : values) value = radians(value);
  return values;
}
inline std::vector<double> degrees(std::vector<double> values) {
  for (double& value : values) value = degrees(value);
  return values;
}

}  // namespace usct
