#include "ros/acquisition_bag.h"

#include <geometry_msgs/TransformStamped.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <std_msgs/String.h>
#include <tf2/buffer_core.h>
#include <tf2/exceptions.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <set>

#include "ros/conversions.h"
#include "ros/frames.h"
#include "ros/sweep_assembler.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using Eigen::Isometry3d;
using ::ros::Duration;
using ::ros::Time;

// What the robot does before and after a sweep: it moves to the place, waits, and leaves again.
constexpr double kArrivalS = 2.5;
constexpr double kStillS = 0.4;
constexpr double kMoveS = 1.0;
constexpr double kTfPeriodS = 0.02;
// Of recordings that are read: as long as any, and longer than any pause that ends a sweep.
constexpr double kTfHistoryS = 1e9;
constexpr double kEndS = 1e6;

/// Messages in order of time, as a recorder gets them.
class Recording {
 public:
  template <typename Message>
  void add(const std::string& topic, const Time& time, const Message& message) {
    add(topic, time, message, {});
  }

  /// A player latches it again: whoever subscribes later gets it as well.
  template <typename Message>
  void add_latched(const std::string& topic, const Time& time, const Message& message) {
    auto header = boost::make_shared<::ros::M_string>();
    (*header)["type"] = ::ros::message_traits::datatype(message);
    (*header)["md5sum"] = ::ros::message_traits::md5sum(message);
    (*header)["message_definition"] = ::ros::message_traits::definition(message);
    (*header)["callerid"] = "/usct_bag";
    (*header)["latching"] = "1";
    add(topic, time, message, header);
  }

  void write(const std::filesystem::path& path) const {
    rosbag::Bag bag(path.string(), rosbag::bagmode::Write);
    for (const auto& [time, write] : messages_) write(bag);
    bag.close();
  }

 private:
  template <typename Message>
  void add(const std::string& topic, const Time& time, const Message& message,
           const boost::shared_ptr<::ros::M_string>& header) {
    auto shared = std::make_shared<const Message>(message);
    messages_.emplace(time, [=](rosbag::Bag& bag) { bag.write(topic, time, *shared, header); });
  }

  std::multimap<Time, std::function<void(rosbag::Bag&)>> messages_;
};

struct StampedPose {
  Time stamp;
  Isometry3d T;
};

geometry_msgs::TransformStamped stamped(const Time& stamp, const Isometry3d& T_parent_child,
                                        const std::string& parent, const std::string& child) {
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = stamp;
  transform.header.frame_id = parent;
  transform.child_frame_id = child;
  transform.transform = to_message(T_parent_child);
  return transform;
}

/// Away from what the probe looks at.
Isometry3d retracted(const Isometry3d& T, double distance_mm) {
  return T * Eigen::Translation3d(0.0, -distance_mm, 0.0);
}

/// The time after a sweep's last pose (direction 1), or before its first one (-1): the probe stands
/// still for a moment, then it is on its way.
void add_departure(const StampedPose& from, double duration_s, int direction, double retract_mm,
                   std::vector<StampedPose>& path) {
  const int steps = static_cast<int>(std::lround(duration_s / kTfPeriodS));
  for (int step = 1; step <= steps; ++step) {
    const double since_s = step * kTfPeriodS;
    const double moved = std::clamp((since_s - kStillS) / kMoveS, 0.0, 1.0);
    path.push_back(
        {from.stamp + Duration(direction * since_s), retracted(from.T, moved * retract_mm)});
  }
}

/// The sweeps' own poses, and arrivals and departures around them.
std::vector<StampedPose> robot_path(const std::vector<std::vector<StampedPose>>& sweeps,
                                    double pause_s, double retract_mm) {
  std::vector<StampedPose> path;
  for (std::size_t i = 0; i < sweeps.size(); ++i) {
    // No two transforms of one stamp where a departure meets the next arrival.
    const double before_s = i == 0 ? kArrivalS : pause_s / 2.0 - kTfPeriodS;
    const double after_s = i + 1 == sweeps.size() ? pause_s : pause_s / 2.0;
    add_departure(sweeps[i].front(), before_s, -1, retract_mm, path);
    path.insert(path.end(), sweeps[i].begin(), sweeps[i].end());
    add_departure(sweeps[i].back(), after_s, +1, retract_mm, path);
  }
  return path;
}

std::vector<StampedPose> held(const Isometry3d& T, const Time& first, const Time& last) {
  std::vector<StampedPose> poses;
  for (Time t = first; t < last; t += Duration(kTfPeriodS)) poses.push_back({t, T});
  poses.push_back({last, T});
  return poses;
}

void record_path(const std::vector<StampedPose>& path, const std::string& parent,
                 const std::string& child, Recording& recording) {
  for (const StampedPose& pose : path) {
    tf2_msgs::TFMessage message;
    message.transforms = {stamped(pose.stamp, pose.T, parent, child)};
    recording.add("/tf", pose.stamp, message);
  }
}

/// A sweep as it goes into the bag.
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

/// Fixed frame -> US frame. A tracked probe's US frame does not move with the probe.
void record_us_frame(const std::vector<Sweep>& sweeps, const BagOptions& options, const Time& begin,
                     Recording& recording) {
  const bool motorised = sweeps.front().acquisition->us.geometry.is_motorised();
  const double retract_mm = motorised ? options.retract_mm : 0.0;
  if (is_static(sweeps, retract_mm)) {
    tf2_msgs::TFMessage message;
    message.transforms = {stamped(begin, *sweeps.front().acquisition->T_fixed_us,
                                  options.fixed_frame, options.us_frame)};
    recording.add_latched("/tf_static", begin, message);
    return;
  }
  std::vector<std::vector<StampedPose>> stays;
  for (const Sweep& sweep : sweeps)
    stays.push_back(held(*sweep.acquisition->T_fixed_us, sweep.first(), sweep.last()));
  record_path(robot_path(stays, options.pause_s, retract_mm), options.fixed_frame, options.us_frame,
              recording);
}

/// US frame -> array, and the frames without poses.
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
      stamped(sweep.last(), T_parent_ct, anchored ? options.fixed_frame : options.us_frame,
              options.ct_frame));
}

void record_ct(const BagCt& ct, const BagOptions& options, const Time& begin,
               Recording& recording) {
  if (ct.volume) {
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

void require(bool fulfilled, const std::string& option, double value, const char* constraint) {
  if (!fulfilled)
    throw InputError("bag",
                     "'" + option + "' is " + std::to_string(value) + ", must be " + constraint);
}

void require_frame(const std::string& option, const std::string& frame) {
  if (frame.empty() || frame.front() == '/')
    throw InputError("bag", "'" + option + "' is '" + frame +
                                "', must be the name of a frame, without a slash in front");
}

/// Reads by the type of messages: recordings have the topics of whoever recorded.
class BagReader {
 public:
  explicit BagReader(const std::filesystem::path& path) : path_(path), bag_(path.string()) {}

  void visit_ct(const BagVisitor& visitor) const {
    for_each<msg::CtVolume>(
        [&](const msg::CtVolume::ConstPtr& message, const Time&) { visitor.ct(*message); });
  }

  void visit_ultrasound(const BagVisitor& visitor) const {
    const int volumes = for_each<msg::PreScanVolume>(
        [&](const msg::PreScanVolume::ConstPtr& message, const Time&) { visitor.us(*message); });
    if (volumes == 0) assemble(visitor);
  }

 private:
  /// Returns how many there are. Messages of this type on several topics are an InputError.
  template <typename Message>
  int for_each(
      const std::function<void(const typename Message::ConstPtr&, const Time&)>& take) const {
    const std::string type = ::ros::message_traits::datatype<Message>();
    rosbag::View view(bag_, rosbag::TypeQuery(type));
    std::set<std::string> topics;
    for (const rosbag::ConnectionInfo* connection : view.getConnections())
      topics.insert(connection->topic);
    if (topics.size() > 1)
      throw InputError(path_.string(), "has " + type + " on several topics (" + *topics.begin() +
                                           ", " + *topics.rbegin() +
                                           "), must be one: 'rosbag filter' keeps one");
    int count = 0;
    for (const rosbag::MessageInstance& instance : view) {
      const typename Message::ConstPtr message = instance.instantiate<Message>();
      if (!message)
        throw InputError(path_.string(), "has " + type + " of another version of this package");
      take(message, instance.getTime());
      ++count;
    }
    return count;
  }

  void assemble(const BagVisitor& visitor) const {
    tf2::BufferCore tf{Duration(kTfHistoryS)};
    read_tf(tf);
    SweepAssembler assembler{AssemblyOptions()};
    const auto pass_on = [&](const std::vector<EndedSweep>& sweeps) {
      for (const EndedSweep& sweep : sweeps) {
        if (!sweep.message.empty())
          visitor.warning("sweep " + std::to_string(sweep.number) + ": " + sweep.message);
        if (sweep.volume) visitor.us(*sweep.volume);
      }
    };
    Time last;
    for_each<msg::PreScanFrame>([&](const msg::PreScanFrame::ConstPtr& frame, const Time& time) {
      pass_on(assembler.end_after_pause(time));
      pass_on(assembler.add(with_pose(frame, tf), time));
      last = time;
    });
    pass_on(assembler.end_after_pause(last + Duration(kEndS)));
  }

  void read_tf(tf2::BufferCore& tf) const {
    rosbag::View view(bag_, rosbag::TypeQuery("tf2_msgs/TFMessage"));
    for (const rosbag::MessageInstance& instance : view) {
      const std::string& topic = instance.getTopic();
      const bool is_static = topic.size() >= 10 && topic.substr(topic.size() - 10) == "/tf_static";
      const tf2_msgs::TFMessage::ConstPtr message = instance.instantiate<tf2_msgs::TFMessage>();
      for (const geometry_msgs::TransformStamped& transform : message->transforms)
        tf.setTransform(transform, "bag", is_static);
    }
  }

  /// A tracked frame without a pose: that of its frame in the frame's parent, which the US frame
  /// is.
  static StreamedFrame with_pose(const msg::PreScanFrame::ConstPtr& frame,
                                 const tf2::BufferCore& tf) {
    StreamedFrame streamed;
    streamed.frame = frame;
    if (frame->geometry.type == msg::ProbeGeometry::MOTORISED_CURVILINEAR ||
        !frame->pose_frame_id.empty())
      return streamed;
    const Time& stamp = frame->header.stamp;
    if (!tf._getParent(frame->header.frame_id, stamp, streamed.tf_frame_id)) {
      streamed.tf_error = "tf does not know '" + frame->header.frame_id + "' at the stamp";
      return streamed;
    }
    try {
      streamed.tf_pose = to_pose_message(from_message_mm(
          tf.lookupTransform(streamed.tf_frame_id, frame->header.frame_id, stamp).transform, "tf"));
    } catch (const tf2::TransformException& error) {
      streamed.tf_error = error.what();
    }
    return streamed;
  }

  std::filesystem::path path_;
  rosbag::Bag bag_;
};

}  // namespace

void BagOptions::validate() const {
  require(start.toSec() >= 3.0, "start", start.toSec(), ">= 3 s after the epoch");
  require(std::isfinite(frame_rate_hz) && frame_rate_hz > 0.0, "frame_rate_hz", frame_rate_hz,
          "> 0");
  require(std::isfinite(pause_s) && pause_s >= 3.0, "pause_s", pause_s, ">= 3");
  require(std::isfinite(retract_mm) && retract_mm >= 0.0, "retract_mm", retract_mm, ">= 0");
  require_frame("fixed_frame", fixed_frame);
  require_frame("us_frame", us_frame);
  require_frame("array_frame", array_frame);
  require_frame("ct_frame", ct_frame);
}

void write_acquisition_bag(const std::vector<BagAcquisition>& acquisitions, const BagCt& ct,
                           const BagOptions& options, const std::filesystem::path& path) {
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
  if (acquisitions.front().T_fixed_us) record_us_frame(sweeps, options, begin, recording);
  if (options.poses_in_tf) move_poses_to_tf(sweeps, options, recording);
  for (const Sweep& sweep : sweeps)
    for (const msg::PreScanFrame& frame : sweep.frames)
      recording.add("/us/frames", frame.header.stamp, frame);
  write_atomically(path,
                   [&](const std::filesystem::path& temporary) { recording.write(temporary); });
}

void visit_acquisition_bag(const std::filesystem::path& path, const BagVisitor& visitor) {
  try {
    const BagReader reader(path);
    if (visitor.us) reader.visit_ultrasound(visitor);
    if (visitor.ct) reader.visit_ct(visitor);
  } catch (const rosbag::BagException& error) {
    throw InputError(path.string(), error.what());
  }
}

}  // namespace usct::ros_interface
