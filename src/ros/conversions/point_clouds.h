#pragma once

#include <pcl_msgs/PolygonMesh.h>
#include <sensor_msgs/PointCloud2.h>

#include <map>
#include <string>
#include <vector>

#include "us_ct_registration/rendering/point_clouds.h"
#include "us_ct_registration/rendering/surface.h"

/// Points and meshes as messages of PCL.
namespace usct::ros_interface {

/// x, y, z (m) and intensity, 32-bit floats.
sensor_msgs::PointCloud2 to_message(const std::vector<CloudPoint>& points,
                                    const std_msgs::Header& header);

/// The points of surfaces by label: x, y, z (float32, m) and label (uint32). The stamp is 0,
/// because the points are valid at any time.
sensor_msgs::PointCloud2 to_points(const std::map<int, Surface>& surfaces,
                                   const std::string& frame);

/// The surfaces as one mesh: the cloud of `to_points`, and each triangle as a polygon of its
/// points, anticlockwise as seen from outside, in the order of the labels. No two labels share a
/// point.
pcl_msgs::PolygonMesh to_mesh(const std::map<int, Surface>& surfaces, const std::string& frame);

}  // namespace usct::ros_interface
