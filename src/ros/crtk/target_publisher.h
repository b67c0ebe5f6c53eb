#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/subscriber.h>
#include <ros/timer.h>

#include <Eigen/Geometry>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "ros/overlay/overlay_scene.h"
#include "ros/tf/tf_buffer.h"
#include "ros/tf/tf_input.h"

namespace usct::ros_interface {

/// A point of the CT that the robot wants to know.
struct Target {
  std::string name;
  /// Name of the structure of `ct/surface` whose centre of volume is the point; empty: `point_mm`.
  std::string surface;
  /// In the frame of the CT with this checksum.
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  std::uint32_t ct_crc32 = 0;
};

struct TargetOptions {
  /// The frame of the robot in which the targets are published.
  std::string frame;
  std::vector<Target> targets;
  double rate_hz = 10.0;
  double tf_timeout_s = 0.1;
};

/// The centre of the volume that a closed surface encloses, mm; not finite if it encloses none.
Eigen::Vector3d centre_of_volume_mm(const Surface& surface);

/// Publishes points of the CT as a robot reads poses (CRTK): `targets/NAME/measured_cp`, a
/// geometry_msgs/PoseStamped in the robot's frame, with the axes of the CT. Nothing is published
/// while there is no accepted alignment, while the surfaces are of another CT, or while tf does not
/// have the CT where the alignment has it.
class TargetPublisher {
 public:
  TargetPublisher(const ::ros::NodeHandle& node, TargetOptions options);

  /// The reasons why targets are not published, or what speaks against the alignment, in words.
  struct Report {
    std::string problem;
    std::vector<std::string> warnings;
  };
  Report report() const;

 private:
  void publish();
  /// Returns why single targets are not published; empty if all are. Throws InputError if none can
  /// be.
  std::string publish_at(const ::ros::Time& now);
  Eigen::Vector3d point_mm(const Target& target, const OverlayScene& scene) const;

  ::ros::NodeHandle node_;
  const TargetOptions options_;
  OverlaySceneKeeper keeper_;
  TfBuffer tf_;
  TfInput tf_input_;
  std::vector<::ros::Subscriber> subscribers_;
  std::vector<::ros::Publisher> publishers_;  // as options_.targets
  mutable std::mutex mutex_;                  // guards report_
  Report report_;
  ::ros::WallTimer timer_;
};

}  // namespace usct::ros_interface
