#include "ros/ct_surface.h"

#include <sensor_msgs/point_cloud2_iterator.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>

#include "ros/conversions.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

/// Steps of the golden ratio around the circle of hues: neighbours differ, whatever the numbers.
std_msgs::ColorRGBA colour_of(int label) {
  constexpr double kGoldenRatio = 0.618033988749895;
  const double hue = 6.0 * std::fmod(kGoldenRatio * label, 1.0);
  const auto channel = [hue](double shift) {
    const double k = std::fmod(hue + shift, 6.0);
    return static_cast<float>(1.0 - 0.7 * std::clamp(std::min(k, 4.0 - k), 0.0, 1.0));
  };
  std_msgs::ColorRGBA colour;
  colour.r = channel(5.0);
  colour.g = channel(3.0);
  colour.b = channel(1.0);
  colour.a = 1.0F;
  return colour;
}

visualization_msgs::Marker to_marker(int label, const Surface& surface, const std::string& name,
                                     const std::string& frame) {
  visualization_msgs::Marker marker;
  marker.header.frame_id = frame;
  marker.ns = name;
  marker.id = label;
  marker.type = visualization_msgs::Marker::TRIANGLE_LIST;
  marker.action = visualization_msgs::Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.scale.x = marker.scale.y = marker.scale.z = 1.0;
  marker.color = colour_of(label);
  marker.frame_locked = true;
  marker.points.reserve(3 * surface.triangles.size());
  for (const auto& triangle : surface.triangles)
    for (const std::uint32_t corner : triangle)
      marker.points.push_back(to_message(surface.points_mm[corner]));
  return marker;
}

}  // namespace

std::map<int, std::string> label_names_from(const std::string& text, const std::string& source) {
  std::map<int, std::string> names;
  std::istringstream entries(text);
  for (std::string entry; std::getline(entries, entry, ';');) {
    std::istringstream words(entry);
    int label = 0;
    std::string name;
    const bool is_read = static_cast<bool>(words >> label >> std::ws) &&
                         static_cast<bool>(std::getline(words, name));
    if (!is_read || label < 1 || label > std::numeric_limits<std::uint16_t>::max())
      throw InputError(source, "has the entry '" + entry +
                                   "', must be a number in [1, 65535] and a name, like '1 kidney'");
    name.erase(name.find_last_not_of(' ') + 1);
    if (!names.emplace(label, name).second)
      throw InputError(source, "names label " + std::to_string(label) + " twice");
  }
  return names;
}

std::string label_text(int label, const std::map<int, std::string>& names) {
  const auto name = names.find(label);
  return std::to_string(label) + " " + (name == names.end() ? "label" : name->second);
}

visualization_msgs::MarkerArray to_markers(const std::map<int, Surface>& surfaces,
                                           const std::map<int, std::string>& names,
                                           const std::string& frame) {
  visualization_msgs::MarkerArray array;
  visualization_msgs::Marker clear;
  clear.header.frame_id = frame;
  clear.pose.orientation.w = 1.0;
  clear.action = visualization_msgs::Marker::DELETEALL;
  array.markers.push_back(clear);
  for (const auto& [label, surface] : surfaces)
    array.markers.push_back(to_marker(label, surface, label_text(label, names), frame));
  return array;
}

sensor_msgs::PointCloud2 to_points(const std::map<int, Surface>& surfaces,
                                   const std::string& frame) {
  using sensor_msgs::PointField;
  std::size_t count = 0;
  for (const auto& [label, surface] : surfaces) count += surface.points_mm.size();
  sensor_msgs::PointCloud2 cloud;
  cloud.header.frame_id = frame;
  cloud.height = 1;
  cloud.is_dense = 1;
  sensor_msgs::PointCloud2Modifier modifier(cloud);
  modifier.setPointCloud2Fields(4, "x", 1, PointField::FLOAT32, "y", 1, PointField::FLOAT32, "z", 1,
                                PointField::FLOAT32, "label", 1, PointField::UINT32);
  modifier.resize(count);
  sensor_msgs::PointCloud2Iterator<float> x(cloud, "x");
  sensor_msgs::PointCloud2Iterator<std::uint32_t> number(cloud, "label");
  for (const auto& [label, surface] : surfaces)
    for (const Eigen::Vector3d& p_mm : surface.points_mm) {
      for (int axis = 0; axis < 3; ++axis) x[axis] = static_cast<float>(p_mm[axis] / kMmPerM);
      *number = static_cast<std::uint32_t>(label);
      ++x;
      ++number;
    }
  return cloud;
}

}  // namespace usct::ros_interface
