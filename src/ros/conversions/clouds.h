#pragma once

#include <sensor_msgs/PointCloud2.h>
#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/rendering/point_clouds.h"
#include "us_ct_registration/rendering/surface.h"

/// Clouds and surfaces as messages.
namespace usct::ros_interface {

/// x, y, z (m) and intensity, 32-bit floats.
sensor_msgs::PointCloud2 to_message(const std::vector<CloudPoint>& points,
                                    const std_msgs::Header& header);

/// The points of surfaces by label: x, y, z (float32, m) and label (uint32). The stamp is 0,
/// because the points are valid at any time.
sensor_msgs::PointCloud2 to_points(const std::map<int, Surface>& surfaces,
                                   const std::string& frame);

/// A marker that deletes those of the previous CT, then a TRIANGLE_LIST per surface, with the label
/// as its id and the name as its namespace. The stamp is 0, as for `to_points`.
visualization_msgs::MarkerArray to_markers(const std::map<int, Surface>& surfaces,
                                           const std::map<int, std::string>& names,
                                           const std::string& frame);

/// The markers of the CT's surfaces, transformed to another frame so that tf is not needed, with
/// opacity `alpha`. If the pose is not known, a marker that deletes all others.
visualization_msgs::MarkerArray placed(const visualization_msgs::MarkerArray& surfaces_ct,
                                       const std::string& frame,
                                       const std::optional<Eigen::Isometry3d>& T_frame_ct,
                                       double alpha);

/// What shows a refused pose and cannot be taken for an alignment: a marker that deletes those
/// before, the surfaces of the CT at that pose, all in red with opacity `alpha` and the namespace
/// "REFUSED", and a text at `text_mm` that says REFUSED and why. In `frame`.
visualization_msgs::MarkerArray refused_markers(const visualization_msgs::MarkerArray& surfaces_ct,
                                                const std::string& frame,
                                                const Eigen::Isometry3d& T_frame_ct, double alpha,
                                                const std::string& reason,
                                                const Eigen::Vector3d& text_mm);

}  // namespace usct::ros_interface
