#include "ros/bags/frame_stream.h"

#include "ros/conversions/probe.h"
#include "ros/conversions/ultrasound.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

::ros::Time stamp_of(const msg::PreScanVolume& volume, std::size_t frame, const FrameStream& how) {
  if (!volume.frame_stamps.empty()) return volume.frame_stamps[frame];
  const ::ros::Duration before_end =
      how.frame_period * static_cast<double>(volume.frames - 1 - frame);
  if (volume.header.stamp.toSec() < before_end.toSec())
    throw InputError("pre-scan volume", "its stamp is " +
                                            std::to_string(volume.header.stamp.toSec()) +
                                            " s, must be >= " + std::to_string(before_end.toSec()) +
                                            " s: else its first frame lies before the epoch");
  return volume.header.stamp - before_end;
}

}  // namespace

std::vector<msg::PreScanFrame> frames_of(const msg::PreScanVolume& volume,
                                         const FrameStream& stream) {
  from_message(volume, "pre-scan volume");  // throws if it is not valid
  const bool motorised = is_motorised(volume.geometry);
  const std::size_t pixels = static_cast<std::size_t>(volume.samples) * volume.lines;
  std::vector<msg::PreScanFrame> frames(volume.frames);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    msg::PreScanFrame& frame = frames[i];
    frame.header.stamp = stamp_of(volume, i, stream);
    frame.header.frame_id = motorised ? volume.header.frame_id : stream.array_frame_id;
    frame.sweep = stream.sweep;
    frame.index = static_cast<std::uint32_t>(i);
    frame.frames_in_sweep = volume.frames;
    frame.geometry = volume.geometry;
    if (motorised) {
      frame.motor_angle = volume.frame_angles[i];
      frame.motor_travel = volume.frame_travel;
    } else {
      frame.pose_frame_id = volume.header.frame_id;
      frame.pose = volume.frame_poses[i];
    }
    frame.samples = volume.samples;
    frame.lines = volume.lines;
    const auto begin = volume.data.begin() + static_cast<std::ptrdiff_t>(i * pixels);
    frame.data.assign(begin, begin + static_cast<std::ptrdiff_t>(pixels));
  }
  return frames;
}

}  // namespace usct::ros_interface
