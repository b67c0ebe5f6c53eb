#include "ros/conversions/ultrasound.h"

#include <algorithm>

#include "ros/conversions/checks.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/probe.h"
#include "ros/conversions/times.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

void fill_motion(const MotorSweep& motor, msg::PreScanVolume& message) {
  message.frame_angles = motor.frame_angles_rad;
  message.frame_travel = motor.frame_travel_rad;
}

void fill_motion(const TrackedSweep& tracked, msg::PreScanVolume& message) {
  for (const Eigen::Isometry3d& T : tracked.T_us_frame)
    message.frame_poses.push_back(to_pose_message(T));
  for (const double time_s : tracked.frame_times_s)
    message.frame_stamps.push_back(message.header.stamp +
                                   ::ros::Duration(time_s - tracked.frame_times_s.back()));
}

MotorSweep motor_from_message(const msg::PreScanVolume& message, const std::string& source) {
  require_unused("frame_poses", message.frame_poses.empty(), source);
  require_count("frame_angles", message.frame_angles.size(), message.frames, source);
  return {kMmPerM * message.geometry.motor_radius, message.frame_angles, message.frame_travel};
}

TrackedSweep tracked_from_message(const msg::PreScanVolume& message, const std::string& source) {
  require_unused("frame_angles", message.frame_angles.empty(), source);
  require_unused("frame_travel", message.frame_travel == 0.0, source);
  require_count("frame_poses", message.frame_poses.size(), message.frames, source);
  TrackedSweep tracked;
  for (std::size_t i = 0; i < message.frame_poses.size(); ++i)
    tracked.T_us_frame.push_back(from_message_mm(
        message.frame_poses[i], source + ": 'frame_poses[" + std::to_string(i) + "]'"));
  for (const ::ros::Time& stamp : message.frame_stamps)
    tracked.frame_times_s.push_back(seconds_between(message.frame_stamps.front(), stamp));
  return tracked;
}

/// tf is asked for the pose at each of them, where 0 stands for the newest transform.
void require_frame_stamps(const msg::PreScanVolume& message, const std::string& source) {
  const std::vector<::ros::Time>& stamps = message.frame_stamps;
  if (stamps.empty()) return;
  require_count("frame_stamps", stamps.size(), message.frames, source);
  require(!stamps.front().isZero(), source, "'frame_stamps[0]' is 0, must be set");
  require(std::is_sorted(stamps.begin(), stamps.end()), source,
          "'frame_stamps' fall, must be in the order of acquisition");
  require(stamps.back() <= message.header.stamp, source,
          "'frame_stamps' end at " + seconds_text(stamps.back()) +
              ", must not be later than 'header.stamp', the end of the acquisition, which is " +
              seconds_text(message.header.stamp));
}

}  // namespace

msg::PreScanVolume to_message(const PreScanVolume& volume, const std_msgs::Header& header) {
  volume.validate("pre-scan volume");
  msg::PreScanVolume message;
  message.header = header;
  message.geometry = to_probe_message(volume.geometry);
  message.samples = static_cast<std::uint32_t>(volume.geometry.samples());
  message.lines = static_cast<std::uint32_t>(volume.geometry.lines());
  message.frames = static_cast<std::uint32_t>(volume.geometry.frames());
  std::visit([&](const auto& motion) { fill_motion(motion, message); }, volume.geometry.motion);
  message.data = volume.voxels;
  message.crc32 = checksum(message.data);
  return message;
}

PreScanVolume from_message(const msg::PreScanVolume& message, const std::string& source) {
  require_size({{"samples", message.samples}, {"lines", message.lines}, {"frames", message.frames}},
               message.data.size(), source);
  PreScanVolume volume;
  ScanGeometry& geometry = volume.geometry;
  geometry.axial = axial_from_message(message.geometry, message.samples, source);
  geometry.array = array_from_message(message.geometry, message.lines, source);
  require_frame_stamps(message, source);
  if (is_motorised(message.geometry))
    geometry.motion = motor_from_message(message, source);
  else
    geometry.motion = tracked_from_message(message, source);
  geometry.validate(source);
  require_checksum(checksum(message.data), message.crc32, source);
  volume.voxels = message.data;
  return volume;
}

}  // namespace usct::ros_interface
