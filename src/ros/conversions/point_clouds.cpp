#include "ros/conversions/point_clouds.h"

#include <pcl/point_cloud.h>
#include <pcl_conversions/pcl_conversions.h>

#include <cstdint>

#include "ros/conversions/cloud_point_types.h"
#include "ros/conversions/poses.h"

namespace usct::ros_interface {
namespace {

template <typename Point, typename Value>
Point point_of(const Eigen::Vector3d& p_mm, Value value) {
  const Eigen::Vector3f p_m = (p_mm / kMmPerM).cast<float>();
  return {p_m.x(), p_m.y(), p_m.z(), value};
}

template <typename Point>
sensor_msgs::PointCloud2 cloud_message(const pcl::PointCloud<Point>& cloud,
                                       const std_msgs::Header& header) {
  sensor_msgs::PointCloud2 message;
  pcl::toROSMsg(cloud, message);
  // PCL's header has no room for the nanoseconds of a stamp.
  message.header = header;
  return message;
}

}  // namespace

sensor_msgs::PointCloud2 to_message(const std::vector<CloudPoint>& points,
                                    const std_msgs::Header& header) {
  pcl::PointCloud<BrightPoint> cloud;
  cloud.reserve(points.size());
  for (const CloudPoint& point : points)
    cloud.push_back(point_of<BrightPoint>(point.p_mm, point.intensity));
  return cloud_message(cloud, header);
}

sensor_msgs::PointCloud2 to_points(const std::map<int, Surface>& surfaces,
                                   const std::string& frame) {
  pcl::PointCloud<LabelledPoint> cloud;
  for (const auto& [label, surface] : surfaces)
    for (const Eigen::Vector3d& p_mm : surface.points_mm)
      cloud.push_back(point_of<LabelledPoint>(p_mm, static_cast<std::uint32_t>(label)));
  std_msgs::Header header;
  header.frame_id = frame;
  return cloud_message(cloud, header);
}

pcl_msgs::PolygonMesh to_mesh(const std::map<int, Surface>& surfaces, const std::string& frame) {
  pcl_msgs::PolygonMesh mesh;
  mesh.cloud = to_points(surfaces, frame);
  mesh.header = mesh.cloud.header;
  std::uint32_t first = 0;
  for (const auto& [label, surface] : surfaces) {
    for (const auto& [a, b, c] : surface.triangles)
      mesh.polygons.emplace_back().vertices = {first + a, first + b, first + c};
    first += static_cast<std::uint32_t>(surface.points_mm.size());
  }
  return mesh;
}

}  // namespace usct::ros_interface
