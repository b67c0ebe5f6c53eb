#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <us_ct_registration/Alignment.h>
#include <us_ct_registration/CtVolume.h>
#include <us_ct_registration/PreScanVolume.h>
#include <us_ct_registration/RegistrationResult.h>
#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "ros/alignment/alignment_watch.h"
#include "ros/tf/tf_buffer.h"
#include "ros/tf/tf_input.h"
#include "ros/tf/tf_wait.h"
#include "us_ct_registration/rendering/point_clouds.h"

namespace usct::ros_interface {

/// The node `us_cloud` publishes clouds for rviz: ultrasound (two fans, and the volume), the CT on
/// the same fans, and the CT's surfaces (rviz drops those that arrive before tf has the CT). All
/// are in the fixed frame, where they stay when the probe moves away. If a registration of this
/// ultrasound was refused, the node shows its best candidate as well, in red and beside the reason,
/// on topics of its own and never in tf; likewise, in amber, an alignment that waits for a person.
/// The node gives tf two frames that mark the ultrasound and the middle of its field.
/// docs/nodes/us_cloud.md.
class UsCloud {
 public:
  UsCloud(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);

 private:
  /// The ultrasound that is shown.
  struct Shown {
    std_msgs::Header header;  // frame_id: that of the clouds
    std::vector<CloudPoint> fans;
    Eigen::Isometry3d T_cloud_us = Eigen::Isometry3d::Identity();
    /// Points behind the array and beyond the field, where a text hides nothing.
    Eigen::Vector3d above_mm = Eigen::Vector3d::Zero();
    Eigen::Vector3d below_mm = Eigen::Vector3d::Zero();
    /// A point above the text at `above_mm`.
    Eigen::Vector3d far_above_mm = Eigen::Vector3d::Zero();
  };
  /// The last published pose of the CT, or the one that waits for a decision.
  struct Placement {
    std::string fixed_frame;
    std::string message;
    std::optional<Eigen::Isometry3d> T_fixed_ct;
    std::uint32_t ct_crc32 = 0;
  };

  void take_ultrasound(const us_ct_registration::PreScanVolumeConstPtr& message);
  /// Tries the ultrasound again that tf could not place: frames may be connected after it came.
  void show_unplaced();
  /// Waits for tf, `tf_wait_s` at most. `showing_` must be held.
  void show_ultrasound(const us_ct_registration::PreScanVolumeConstPtr& message, double tf_wait_s);
  /// Throws InputError, tf2::TransformException or Refusal.
  Shown publish_ultrasound(const us_ct_registration::PreScanVolume& message, double tf_wait_s);
  void take_ct(const us_ct_registration::CtVolumeConstPtr& message);
  static Placement placement_of(const us_ct_registration::Alignment& message);
  void take_alignment(const us_ct_registration::AlignmentConstPtr& message);
  /// Shows the CT again if tf has lost the alignment that is in force, or has it again.
  void look_for_alignment();
  void take_proposed(const us_ct_registration::AlignmentConstPtr& message);
  void take_surface(const visualization_msgs::MarkerArrayConstPtr& message);
  void take_result(const us_ct_registration::RegistrationResultConstPtr& message);
  /// The pose of the ultrasound in the fixed frame, mm, at the stamp of `header`, whose frame
  /// becomes the fixed one; sends the node's frames to tf. Throws tf2::TransformException.
  Eigen::Isometry3d look_up_fixed_frame(const ScanGeometry& geometry, double tf_wait_s,
                                        std_msgs::Header& header);
  /// Sets each frame where the ultrasound's frame was at the frame's stamp, as the registration
  /// does. Throws Refusal.
  void follow_frames(const us_ct_registration::PreScanVolume& message,
                     const Eigen::Isometry3d& T_fixed_us, BeamGrid& beams) const;
  /// Whether there are surfaces, and they do not say that they are of another CT.
  bool has_surface_of(std::uint32_t ct_crc32) const;
  /// The frame of clouds and markers; empty without a fixed frame until ultrasound arrives.
  std::string cloud_frame() const;
  /// Publishes the CT on the fans; without ultrasound, there are no points.
  void publish_ct(const ::ros::Publisher& publisher, const std::vector<CloudPoint>& points) const;
  /// Publishes what is known of the CT: where the alignment has it, and where a refused
  /// registration had its best candidate.
  void show_ct();
  /// Publishes the surfaces where an alignment has them that waits for a decision, if any.
  void show_proposed();
  /// Publishes the surfaces and the CT on the fans; an empty cloud while no alignment is in force.
  void show_aligned();
  /// Publishes the best candidate of a refused registration, if it is of the CT and the ultrasound
  /// that are shown; otherwise removes what was shown of another one.
  void show_refused();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& diagnosis);

  std::string fixed_frame_;
  std::string acquired_frame_;
  std::string field_frame_;
  double spacing_mm_ = 0.0;
  double volume_spacing_mm_ = 0.0;
  double surface_alpha_ = 0.0;
  double tf_timeout_s_ = 0.0;
  std::mutex showing_;  // held while ultrasound is shown; guards the next one
  us_ct_registration::PreScanVolumeConstPtr unplaced_;  // the newest, if tf could not place it
  std::mutex mutex_;                                    // guards the members below, up to problem_
  std::optional<Shown> shown_;                          // empty until the first ultrasound arrives
  std::shared_ptr<const CtVolume> ct_;
  std::uint32_t ct_crc32_ = 0;
  visualization_msgs::MarkerArrayConstPtr surface_;
  std::optional<Placement> placement_;  // empty until the first alignment arrives
  AlignmentWatch alignment_watch_;
  std::optional<Placement> proposed_;  // the same for those that wait
  /// The last result, if it was refused and has a candidate.
  us_ct_registration::RegistrationResultConstPtr refused_;
  std::string problem_;  // of the last ultrasound; empty if it is shown
  ::ros::NodeHandle node_;
  TfBuffer tf_{::ros::Duration(kTfHistory_s)};
  TfInput tf_input_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
  ::ros::Publisher us_publisher_;
  ::ros::Publisher volume_publisher_;
  ::ros::Publisher ct_publisher_;
  ::ros::Publisher surface_publisher_;
  ::ros::Publisher proposed_publisher_;
  ::ros::Publisher refused_ct_publisher_;
  ::ros::Publisher refused_surface_publisher_;
  ::ros::Subscriber us_subscriber_;
  ::ros::Subscriber ct_subscriber_;
  ::ros::Subscriber surface_subscriber_;
  ::ros::Subscriber alignment_subscriber_;
  ::ros::Subscriber proposed_subscriber_;
  ::ros::Subscriber result_subscriber_;
  diagnostic_updater::Updater diagnostics_;
  ::ros::WallTimer alignment_timer_;
  ::ros::WallTimer diagnostics_timer_;
};

}  // namespace usct::ros_interface
