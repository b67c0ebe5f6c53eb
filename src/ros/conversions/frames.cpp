#include "ros/conversions/frames.h"

#include <boost/make_shared.hpp>

#include "ros/conversions/checks.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/probe.h"
#include "ros/conversions/times.h"
#include "ros/conversions/ultrasound.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

std::shared_ptr<const std::vector<std::uint8_t>> shared_brightness(
    const msg::PreScanFrame::ConstPtr& message) {
  const auto owner = std::make_shared<const msg::PreScanFrame::ConstPtr>(message);
  return {owner, &message->data};
}

void take_motion(const msg::PreScanFrame& message, ReceivedFrame& frame,
                 const std::string& source) {
  if (is_motorised(message.geometry)) {
    require_unused("pose_frame_id", message.pose_frame_id.empty(), source);
    frame.motor = MotorFrame{kMmPerM * message.geometry.motor_radius, message.motor_angle,
                             message.motor_travel};
    return;
  }
  require_unused("motor_angle", message.motor_angle == 0.0, source);
  require_unused("motor_travel", message.motor_travel == 0.0, source);
  if (message.pose_frame_id.empty()) return;
  frame.pose = FramePose{from_message_mm(message.pose, source + ": 'pose'"), message.pose_frame_id};
  frame.pose_m = message.pose;
}

}  // namespace

void ReceivedFrame::set_looked_up(const geometry_msgs::Pose& looked_up_m,
                                  const std::string& us_frame_id) {
  pose = FramePose{from_message_mm(looked_up_m, name() + ": pose"), us_frame_id, false};
  pose_m = looked_up_m;
}

std::shared_ptr<ReceivedFrame> from_message(const msg::PreScanFrame::ConstPtr& message) {
  auto frame = std::make_shared<ReceivedFrame>();
  frame->sweep = message->sweep;
  frame->index = message->index;
  const std::string source = frame->name();
  require_size({{"samples", message->samples}, {"lines", message->lines}}, message->data.size(),
               source);
  frame->message = message;
  frame->frames_in_sweep = message->frames_in_sweep;
  frame->stamp_ns = nanoseconds_from(message->header.stamp);
  frame->frame_id = message->header.frame_id;
  frame->axial = axial_from_message(message->geometry, message->samples, source);
  frame->array = array_from_message(message->geometry, message->lines, source);
  take_motion(*message, *frame, source);
  frame->brightness = shared_brightness(message);
  return frame;
}

msg::PreScanVolumePtr volume_message(const AssembledSweep& sweep) {
  std_msgs::Header header;
  header.frame_id = sweep.us_frame_id;
  header.stamp = time_from(sweep.stamps_ns.back());
  auto volume = boost::make_shared<msg::PreScanVolume>(to_message(sweep.volume, header));
  volume->frame_stamps.clear();
  for (const std::int64_t stamp_ns : sweep.stamps_ns)
    volume->frame_stamps.push_back(time_from(stamp_ns));
  return volume;
}

msg::PreScanVolumePtr to_message(const AssembledSweep& sweep) {
  const msg::PreScanVolumePtr volume = volume_message(sweep);
  const auto received = [&](std::size_t i) -> const ReceivedFrame& {
    return static_cast<const ReceivedFrame&>(*sweep.frames[i]);
  };
  volume->geometry = received(0).message->geometry;
  if (const auto* tracked = std::get_if<TrackedSweep>(&sweep.volume.geometry.motion))
    for (std::size_t i = 0; i < sweep.frames.size(); ++i)
      if (tracked->T_us_frame[i].matrix() == received(i).pose->T_us_frame.matrix())
        volume->frame_poses[i] = received(i).pose_m;
  return volume;
}

}  // namespace usct::ros_interface
