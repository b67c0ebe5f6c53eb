#include <geometry_msgs/TransformStamped.h>
#include <std_msgs/String.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "ros/bags/acquisition_bag.h"
#include "ros/bags/frame_stream.h"
#include "ros/bags/recording.h"
#include "ros/bags/robot_path.h"
#include "ros/conversions/ct.h"
#include "ros/conversions/message_limit.h"
#include "ros/conversions/poses.h"
#include "ros/conversions/ultrasound.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Eigen::Isometry3d;
using ::ros::Duration;
using ::ros::Time;

constexpr double kCalibrationBeforeVideoS = 0.5;

void record_path(const std::vector<StampedPose>& path, const std::string& parent,
                 const std::string& child, Recording& recording) {
  for (const StampedPose& pose : path) {
    tf2_msgs::TFMessage message;
    message.transforms = {stamped_transform(pose.stamp, pose.T, parent, child)};
    recording.add("/tf", pose.stamp, message);
  }
}

/// The frames of a sweep, as they go into the bag.
struct Sweep {
  std::vector<msg::PreScanFrame> frames;
  const BagAcquisition* acquisition;

  const Time& first() const { return frames.front().header.stamp; }
  const Time& last() const { return frames.back().header.stamp; }
};

Sweep sweep_of(const BagAcquisition& acquisition, unsigned number, const Time& first,
               const BagOptions& options) {
  acquisition.us.validate("ultrasound");
  FrameStream stream;
  stream.sweep = number;
  stream.frame_period = Duration(1.0 / options.frame_rate_hz);
  stream.array_frame_id = options.array_frame;
  Duration length = stream.frame_period * (acquisition.us.geometry.frames() - 1);
  if (const auto* tracked = std::get_if<TrackedSweep>(&acquisition.us.geometry.motion))
    if (!tracked->frame_times_s.empty())
      length = Duration(tracked->frame_times_s.back() - tracked->frame_times_s.front());
  std_msgs::Header header;
  header.stamp = first + length;
  header.frame_id = options.us_frame;
  return {frames_of(to_message(acquisition.us, header), stream), &acquisition};
}

std::vector<Sweep> sweeps_of(const std::vector<BagAcquisition>& acquisitions,
                             const BagOptions& options) {
  std::vector<Sweep> sweeps;
  Time first = options.start;
  for (const BagAcquisition& acquisition : acquisitions) {
    sweeps.push_back(sweep_of(acquisition, static_cast<unsigned>(sweeps.size()), first, options));
    first = sweeps.back().last() + Duration(options.pause_s);
  }
  return sweeps;
}

/// Whether tf connects the two frames by the same transform from the first sweep to the last.
bool is_static(const std::vector<Sweep>& sweeps, double retract_mm) {
  return retract_mm == 0.0 && std::all_of(sweeps.begin(), sweeps.end(), [&](const Sweep& sweep) {
           return sweep.acquisition->T_fixed_us->matrix() ==
                  sweeps.front().acquisition->T_fixed_us->matrix();
         });
}

/// Transforms that hold for the whole bag.
using Statics = std::vector<geometry_msgs::TransformStamped>;

/// All in one message: of several latched ones a late subscriber would get the last alone.
void record_statics(const Statics& statics, const Time& time, Recording& recording) {
  if (statics.empty()) return;
  tf2_msgs::TFMessage message;
  message.transforms = statics;
  recording.add_latched("/tf_static", time, message);
}

/// Records the transform from fixed frame to US frame, or adds it to `statics`. The US frame of a
/// tracked probe does not move with the probe.
void record_us_frame(const std::vector<Sweep>& sweeps, const BagOptions& options, const Time& begin,
                     Recording& recording, Statics& statics) {
  const bool motorised = sweeps.front().acquisition->us.geometry.is_motorised();
  const double retract_mm = motorised ? options.retract_mm : 0.0;
  if (is_static(sweeps, retract_mm)) {
    statics.push_back(stamped_transform(begin, *sweeps.front().acquisition->T_fixed_us,
                                        options.fixed_frame, options.us_frame));
    return;
  }
  std::vector<std::vector<StampedPose>> stays;
  for (const Sweep& sweep : sweeps)
    stays.push_back(held(*sweep.acquisition->T_fixed_us, sweep.first(), sweep.last()));
  record_path(robot_path(stays, options.pause_s, retract_mm), options.fixed_frame, options.us_frame,
              recording);
}

/// Records the poses as transforms from US frame to array, and takes them out of the frames.
void move_poses_to_tf(std::vector<Sweep>& sweeps, const BagOptions& options, Recording& recording) {
  std::vector<std::vector<StampedPose>> tracks;
  for (Sweep& sweep : sweeps) {
    std::vector<StampedPose> track;
    for (msg::PreScanFrame& frame : sweep.frames) {
      track.push_back({frame.header.stamp, from_message_mm(frame.pose, "frame")});
      frame.pose_frame_id.clear();
      frame.pose = geometry_msgs::Pose();
    }
    tracks.push_back(std::move(track));
  }
  record_path(robot_path(tracks, options.pause_s, options.retract_mm), options.us_frame,
              options.array_frame, recording);
}

void record_truth(const Sweep& sweep, const Time& time, const BagOptions& options,
                  Recording& recording) {
  const BagAcquisition& acquisition = *sweep.acquisition;
  if (!acquisition.T_us_ct) return;
  const bool anchored = acquisition.T_fixed_us.has_value();
  const Isometry3d T_parent_ct =
      anchored ? *acquisition.T_fixed_us * *acquisition.T_us_ct : *acquisition.T_us_ct;
  recording.add_latched(
      "/truth/alignment", time,
      stamped_transform(sweep.last(), T_parent_ct,
                        anchored ? options.fixed_frame : options.us_frame, options.ct_frame));
}

void record_ct(const BagCt& ct, const BagOptions& options, const Time& begin,
               Recording& recording) {
  if (ct.volume) {
    const std::uint64_t bytes = sizeof(std::int16_t) * std::uint64_t{ct.volume->grid.voxel_count()};
    if (bytes > kMostMessageBytes)
      throw InputError("CT", "has " + std::to_string(bytes) + " bytes, must have at most " +
                                 std::to_string(kMostMessageBytes) +
                                 " to be played to nodes (roscpp takes no larger message); the bag "
                                 "can name its place instead (--ct-path)");
    std_msgs::Header header;
    header.stamp = begin;
    header.frame_id = options.ct_frame;
    recording.add_latched("/ct/volume", begin, to_message(*ct.volume, header, 1));
  }
  if (!ct.path.empty()) {
    std_msgs::String path;
    path.data = ct.path;
    recording.add_latched("/ct/path", begin, path);
  }
}

/// Records the video, with the anatomy where the last sweep found it. The calibrations are recorded
/// again before it, for a player that starts there.
void record_video(const EndoscopeVideo& video, const Sweep& sweep, const BagOptions& options,
                  const Time& begin, Recording& recording, Statics& statics) {
  const BagAcquisition& acquisition = *sweep.acquisition;
  if (!acquisition.T_fixed_us || !acquisition.T_us_ct)
    throw InputError("bag",
                     "an endoscope is given without the pose of the ultrasound in the fixed frame "
                     "or without the truth, which say where the camera was");
  for (const auto& calibration :
       endoscope_calibration(video, options.fixed_frame, options.endoscope_frames, begin))
    statics.push_back(calibration);
  const Time first = sweep.last() + Duration(options.endoscope_delay_s);
  record_statics(statics, first - Duration(kCalibrationBeforeVideoS), recording);
  record_endoscope(video, *acquisition.T_fixed_us * *acquisition.T_us_ct, options.endoscope_frames,
                   first, recording);
}

void validate_together(const std::vector<BagAcquisition>& acquisitions, const BagOptions& options) {
  if (acquisitions.empty()) throw InputError("bag", "no ultrasound is given, must be one at least");
  const BagAcquisition& first = acquisitions.front();
  for (const BagAcquisition& other : acquisitions) {
    if (other.us.geometry.is_motorised() != first.us.geometry.is_motorised())
      throw InputError("bag", "some sweeps are motorised and some tracked, must be of one kind");
    if (other.T_fixed_us.has_value() != first.T_fixed_us.has_value())
      throw InputError("bag", "some sweeps have a pose in the fixed frame and some have none");
  }
  if (options.poses_in_tf && first.us.geometry.is_motorised())
    throw InputError("bag", "poses cannot go to tf: frames of a motorised probe have angles");
}

void require_option(bool fulfilled, const std::string& option, double value,
                    const char* constraint) {
  if (!fulfilled)
    throw InputError("bag",
                     "'" + option + "' is " + std::to_string(value) + ", must be " + constraint);
}

void require_frame(const std::string& option, const std::string& frame) {
  if (frame.empty() || frame.front() == '/')
    throw InputError("bag", "'" + option + "' is '" + frame +
                                "', must be the name of a frame, without a slash in front");
}

}  // namespace

void BagOptions::validate() const {
  require_option(start.toSec() >= 3.0, "start", start.toSec(), ">= 3 s after the epoch");
  require_option(std::isfinite(frame_rate_hz) && frame_rate_hz > 0.0, "frame_rate_hz",
                 frame_rate_hz, "> 0");
  require_option(std::isfinite(pause_s) && pause_s >= 3.0, "pause_s", pause_s, ">= 3");
  require_option(std::isfinite(retract_mm) && retract_mm >= 0.0, "retract_mm", retract_mm, ">= 0");
  require_option(std::isfinite(endoscope_delay_s) && endoscope_delay_s >= 1.0, "endoscope_delay_s",
                 endoscope_delay_s, ">= 1");
  require_frame("fixed_frame", fixed_frame);
  require_frame("us_frame", us_frame);
  require_frame("array_frame", array_frame);
  require_frame("ct_frame", ct_frame);
  if (std::set<std::string>{fixed_frame, us_frame, array_frame, ct_frame}.size() < 4)
    throw InputError("bag options", "the frames are '" + fixed_frame + "', '" + us_frame + "', '" +
                                        array_frame + "' and '" + ct_frame +
                                        "', must have four different names");
}

void write_acquisition_bag(const std::vector<BagAcquisition>& acquisitions, const BagCt& ct,
                           const BagOptions& options, const std::filesystem::path& path,
                           const std::optional<EndoscopeVideo>& endoscope) {
  options.validate();
  validate_together(acquisitions, options);
  std::vector<Sweep> sweeps = sweeps_of(acquisitions, options);
  Recording recording;
  const Time begin = options.start - Duration(kArrivalS);
  record_ct(ct, options, begin, recording);
  for (const Sweep& sweep : sweeps)
    record_truth(sweep,
                 &sweep == &sweeps.front() ? begin : sweep.first() - Duration(options.pause_s / 2),
                 options, recording);
  Statics statics;
  if (acquisitions.front().T_fixed_us) record_us_frame(sweeps, options, begin, recording, statics);
  if (endoscope) record_video(*endoscope, sweeps.back(), options, begin, recording, statics);
  record_statics(statics, begin, recording);
  if (options.poses_in_tf) move_poses_to_tf(sweeps, options, recording);
  for (const Sweep& sweep : sweeps)
    for (const msg::PreScanFrame& frame : sweep.frames)
      recording.add("/us/frames", frame.header.stamp, frame);
  write_atomically(path,
                   [&](const std::filesystem::path& temporary) { recording.write(temporary); });
}

}  // namespace usct::ros_interface
