#pragma once

#include <geometry_msgs/Point.h>
#include <geometry_msgs/Pose.h>
#include <geometry_msgs/TransformStamped.h>

#include <Eigen/Geometry>
#include <boost/array.hpp>
#include <string>

/// Points and transforms between the core (millimetres) and messages (metres).
///
/// The files of conversions/ are the only place where core and messages meet. A message is checked
/// before anything is allocated for its content: sizes against the received data, checksums,
/// numbers, geometry. A violation is an InputError that names `source`, the field, its value and
/// the constraint.
namespace usct::ros_interface {

constexpr double kMmPerM = 1000.0;

/// Row by row.
using CovarianceMessage = boost::array<double, 36>;

Eigen::Vector3d point_from_message_mm(const geometry_msgs::Point& point_m);
geometry_msgs::Point to_message(const Eigen::Vector3d& point_mm);

/// The quaternion must have length 1 within 1e-3 (an all-zero one is not a rotation).
Eigen::Isometry3d from_message_mm(const geometry_msgs::Transform& transform_m,
                                  const std::string& source);
Eigen::Isometry3d from_message_mm(const geometry_msgs::Pose& pose_m, const std::string& source);
geometry_msgs::Transform to_message(const Eigen::Isometry3d& T_mm);
geometry_msgs::Pose to_pose_message(const Eigen::Isometry3d& T_mm);

/// Covariances of a small motion: (rotation, translation) in rad and mm in the core, (translation,
/// rotation) in m and rad in messages. The values are not checked.
CovarianceMessage covariance_to_message(const Eigen::Matrix<double, 6, 6>& covariance_mm);
Eigen::Matrix<double, 6, 6> covariance_from_message_mm(const CovarianceMessage& covariance_m);

geometry_msgs::TransformStamped stamped_transform(const ::ros::Time& stamp,
                                                  const Eigen::Isometry3d& T_parent_child_mm,
                                                  const std::string& parent,
                                                  const std::string& child);

}  // namespace usct::ros_interface
