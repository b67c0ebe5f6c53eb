#include "ros/crtk/target_publisher.h"

#include <geometry_msgs/PoseStamped.h>

#include <algorithm>

#include "ros/conversions/poses.h"
#include "ros/node/guarded_queue.h"
#include "ros/overlay/overlay_placement.h"
#include "ros/overlay/scene_topics.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {

Eigen::Vector3d centre_of_volume_mm(const Surface& surface) {
  // The tetrahedra between the triangles and one point: those outside of the surface count
  // negatively. A point nearby keeps the rounding small.
  if (surface.points_mm.empty())
    return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  const Eigen::Vector3d near = surface.points_mm.front();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  double volume = 0.0;
  for (const auto& triangle : surface.triangles) {
    const Eigen::Vector3d a = surface.points_mm[triangle[0]] - near;
    const Eigen::Vector3d b = surface.points_mm[triangle[1]] - near;
    const Eigen::Vector3d c = surface.points_mm[triangle[2]] - near;
    const double part = a.dot(b.cross(c)) / 6.0;
    volume += part;
    moment += part * (a + b + c) / 4.0;
  }
  return near + moment / volume;
}

TargetPublisher::TargetPublisher(const ::ros::NodeHandle& node, TargetOptions options)
    : node_(node), options_(std::move(options)), keeper_({}), tf_input_(tf_, node_) {
  subscribers_ = subscribe_to_scene(node_, keeper_);
  for (const Target& target : options_.targets)
    publishers_.push_back(
        node_.advertise<geometry_msgs::PoseStamped>("targets/" + target.name + "/measured_cp", 10));
  timer_ = node_.createWallTimer(::ros::WallDuration(1.0 / options_.rate_hz),
                                 guarded([this](const ::ros::WallTimerEvent&) { publish(); }));
}

void TargetPublisher::publish() {
  Report report;
  try {
    const ::ros::Time now = ::ros::Time::now();
    report.warnings = keeper_.at(now).warnings;
    report.problem = publish_at(now);
  } catch (const std::exception& error) {
    report.problem = error.what();
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  report_ = report;
}

std::string TargetPublisher::publish_at(const ::ros::Time& now) {
  const OverlayScene scene = keeper_.at(now);
  if (!scene.refusal.empty()) throw InputError("targets", scene.refusal);
  const Eigen::Isometry3d T_frame_ct =
      T_frame_ct_at(tf_, scene, options_.frame, now, now, options_.tf_timeout_s);
  std::string problems;
  if (!keeper_.is_current(scene)) return problems;
  for (std::size_t i = 0; i < options_.targets.size(); ++i) try {
      geometry_msgs::PoseStamped message;
      message.header.stamp = now;
      message.header.frame_id = options_.frame;
      message.pose =
          to_pose_message(T_frame_ct * Eigen::Translation3d(point_mm(options_.targets[i], scene)));
      publishers_[i].publish(message);
    } catch (const InputError& error) {
      problems += (problems.empty() ? "" : "; ") + std::string(error.what());
    }
  return problems;
}

Eigen::Vector3d TargetPublisher::point_mm(const Target& target, const OverlayScene& scene) const {
  if (target.surface.empty()) {
    if (target.ct_crc32 != scene.ct_crc32)
      throw InputError("targets/" + target.name,
                       "'ct_crc32' is " + std::to_string(target.ct_crc32) +
                           ", but the CT that was aligned has " + std::to_string(scene.ct_crc32));
    return target.point_mm;
  }
  const auto is_meant = [&](const OverlayStructure& one) { return one.name == target.surface; };
  const auto found = std::find_if(scene.structures.begin(), scene.structures.end(), is_meant);
  if (found == scene.structures.end())
    throw InputError("targets/" + target.name,
                     "'surface' is '" + target.surface + "', which ct/surface does not have");
  if (std::find_if(found + 1, scene.structures.end(), is_meant) != scene.structures.end())
    throw InputError("targets/" + target.name,
                     "'surface' is '" + target.surface +
                         "', which several structures of ct/surface are called; 'label_table' of "
                         "ct_server gives each label a name of its own");
  const Eigen::Vector3d centre = centre_of_volume_mm(*found->surface);
  if (!centre.allFinite())
    throw InputError("targets/" + target.name, "the surface encloses no volume");
  return centre;
}

TargetPublisher::Report TargetPublisher::report() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return report_;
}

}  // namespace usct::ros_interface
