#pragma once

#include <ros/ros.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/CtVolume.h>
#include <us_ct_registration/PreScanVolume.h>
#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Geometry>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/volume.h"

namespace usct::ros_interface {

/// A place of the ultrasound's field of view, and what is seen there.
struct CloudPoint {
  Eigen::Vector3d p_mm;
  float intensity;
};

/// The samples of the middle frame and of the middle line of all frames: two fans that cross, in
/// the US frame. Along the lines every so many samples that they are `spacing_mm` apart, or more.
std::vector<CloudPoint> crossed_fans(const PreScanVolume& volume, double spacing_mm);

/// The whole volume, in the US frame, averaged to about `spacing_mm` along lines and across them.
std::vector<CloudPoint> whole_volume(const PreScanVolume& volume, double spacing_mm);

/// The US frame; of a tracked sweep, whose US frame is the tracker's and may be far away, the frame
/// of its middle image. mm.
Eigen::Isometry3d T_us_acquired(const ScanGeometry& geometry);

/// The middle sample of the middle line of the middle frame, with the axes of `T_us_acquired`. mm.
Eigen::Isometry3d T_us_field(const ScanGeometry& geometry);

/// The CT (HU) at the same places; those outside it are left out.
std::vector<CloudPoint> ct_at(const std::vector<CloudPoint>& points, const CtVolume& ct,
                              const Eigen::Isometry3d& T_ct_points);

/// x, y, z (m) and intensity, 32-bit floats.
sensor_msgs::PointCloud2 to_message(const std::vector<CloudPoint>& points,
                                    const std_msgs::Header& header);

/// The surfaces of the CT where `alignment` has it: in its fixed frame, so that they need no tf;
/// with opacity `alpha`. Without an alignment, a marker that deletes all.
visualization_msgs::MarkerArray placed(const visualization_msgs::MarkerArray& surfaces_ct,
                                       const us_ct_registration::Alignment& alignment,
                                       double alpha);

/// The node `us_cloud`: for rviz, ultrasound (two fans, and the volume) and the CT on the same fans
/// as clouds, and the CT's surfaces (rviz drops those that arrive before tf has the CT).
///
/// Both are published in the fixed frame, where they stay when the probe moves away; tf gets two
/// frames there as well, to look at. docs/nodes/us_cloud.md.
class UsCloud {
 public:
  UsCloud(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);

 private:
  void show_ultrasound(const us_ct_registration::PreScanVolumeConstPtr& message);
  void take_ct(const us_ct_registration::CtVolumeConstPtr& message);
  void take_alignment(const us_ct_registration::AlignmentConstPtr& message);
  void take_surface(const visualization_msgs::MarkerArrayConstPtr& message);
  /// Publishes the surfaces and the CT on the fans; an empty cloud while there is no alignment.
  void show_ct();

  std::string fixed_frame_;
  std::string acquired_frame_;
  std::string field_frame_;
  double spacing_mm_ = 0.0;
  double volume_spacing_mm_ = 0.0;
  double surface_alpha_ = 0.0;
  ::ros::Duration tf_timeout_;
  std::mutex mutex_;
  std_msgs::Header header_;
  std::vector<CloudPoint> fans_;  // in the frame of header_
  std::shared_ptr<const CtVolume> ct_;
  visualization_msgs::MarkerArrayConstPtr surface_;
  us_ct_registration::AlignmentConstPtr alignment_;
  ::ros::NodeHandle node_;
  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener tf_listener_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
  ::ros::Publisher us_publisher_;
  ::ros::Publisher volume_publisher_;
  ::ros::Publisher ct_publisher_;
  ::ros::Publisher surface_publisher_;
  ::ros::Subscriber us_subscriber_;
  ::ros::Subscriber ct_subscriber_;
  ::ros::Subscriber surface_subscriber_;
  ::ros::Subscriber alignment_subscriber_;
};

}  // namespace usct::ros_interface
