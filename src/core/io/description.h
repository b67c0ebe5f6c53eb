#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/scan_geometry.h"

/// Parts of the descriptions that `usct info` prints; see FileFormat::describe.
namespace usct::io {

/// Keeps its keys in the order in which they were added.
using Json = nlohmann::ordered_json;

/// The description as text. Bytes of a file that are not UTF-8 are replaced, so that no text in a
/// file can make a description fail.
std::string as_text(const Json& description);

Json list(const Eigen::Vector3d& v);

/// Adds `range` and `mean` of the voxels, and a warning if all voxels have the same value.
template <typename T>
void describe_range(const std::vector<T>& voxels, Json& json) {
  if (voxels.empty()) return;
  const auto [low, high] = std::minmax_element(voxels.begin(), voxels.end());
  json["range"] = {*low, *high};
  json["mean"] =
      std::accumulate(voxels.begin(), voxels.end(), 0.0) / static_cast<double>(voxels.size());
  if (*low == *high) json["warnings"].push_back("every voxel has the same value");
}

/// Like `describe_range`, for 8-bit ultrasound; warns of saturation as well.
void describe_brightness(const std::vector<std::uint8_t>& voxels, Json& json);

/// Adds the radius of a curvilinear array, and the first and last line with the least and the
/// largest step between lines, in millimetres or degrees.
void describe_array(const Array& array, Json& json);

/// Adds the motor's radius and its angles in the same way.
void describe_motor(const MotorSweep& sweep, Json& json);

}  // namespace usct::io
