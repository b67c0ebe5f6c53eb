#include "ros/conversions/poses.h"

#include "us_ct_registration/geometry/rigid.h"

namespace usct::ros_interface {
namespace {

/// An entry of 1 in the covariance of a message is this much in the units of the core.
double covariance_unit(int row, int column) {
  return (row < 3 ? kMmPerM : 1.0) * (column < 3 ? kMmPerM : 1.0);
}

}  // namespace

Eigen::Vector3d point_from_message_mm(const geometry_msgs::Point& point_m) {
  return kMmPerM * Eigen::Vector3d(point_m.x, point_m.y, point_m.z);
}

geometry_msgs::Point to_message(const Eigen::Vector3d& point_mm) {
  geometry_msgs::Point point;
  point.x = point_mm.x() / kMmPerM;
  point.y = point_mm.y() / kMmPerM;
  point.z = point_mm.z() / kMmPerM;
  return point;
}

Eigen::Isometry3d from_message_mm(const geometry_msgs::Transform& transform_m,
                                  const std::string& source) {
  const auto& q = transform_m.rotation;
  const auto& t = transform_m.translation;
  return rigid_from_quaternion({q.w, q.x, q.y, q.z}, kMmPerM * Eigen::Vector3d(t.x, t.y, t.z),
                               source);
}

Eigen::Isometry3d from_message_mm(const geometry_msgs::Pose& pose_m, const std::string& source) {
  const auto& q = pose_m.orientation;
  return rigid_from_quaternion({q.w, q.x, q.y, q.z}, point_from_message_mm(pose_m.position),
                               source);
}

geometry_msgs::Pose to_pose_message(const Eigen::Isometry3d& T_mm) {
  geometry_msgs::Pose pose;
  pose.position = to_message(Eigen::Vector3d(T_mm.translation()));
  const Eigen::Quaterniond q(T_mm.linear());
  pose.orientation.w = q.w();
  pose.orientation.x = q.x();
  pose.orientation.y = q.y();
  pose.orientation.z = q.z();
  return pose;
}

geometry_msgs::Transform to_message(const Eigen::Isometry3d& T_mm) {
  const geometry_msgs::Pose pose = to_pose_message(T_mm);
  geometry_msgs::Transform transform;
  transform.translation.x = pose.position.x;
  transform.translation.y = pose.position.y;
  transform.translation.z = pose.position.z;
  transform.rotation = pose.orientation;
  return transform;
}

CovarianceMessage covariance_to_message(const Eigen::Matrix<double, 6, 6>& covariance_mm) {
  CovarianceMessage message;
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column)
      message[static_cast<std::size_t>(6 * row + column)] =
          covariance_mm((row + 3) % 6, (column + 3) % 6) / covariance_unit(row, column);
  return message;
}

Eigen::Matrix<double, 6, 6> covariance_from_message_mm(const CovarianceMessage& covariance_m) {
  Eigen::Matrix<double, 6, 6> core;
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column)
      core((row + 3) % 6, (column + 3) % 6) =
          covariance_m[static_cast<std::size_t>(6 * row + column)] * covariance_unit(row, column);
  return core;
}

geometry_msgs::TransformStamped stamped_transform(const ::ros::Time& stamp,
                                                  const Eigen::Isometry3d& T_parent_child_mm,
                                                  const std::string& parent,
                                                  const std::string& child) {
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = stamp;
  transform.header.frame_id = parent;
  transform.child_frame_id = child;
  transform.transform = to_message(T_parent_child_mm);
  return transform;
}

}  // namespace usct::ros_interface
