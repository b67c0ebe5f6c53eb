#include "ros/ingest/frame_stream_source.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "ros/conversions/times.h"
#include "ros/node/guarded_queue.h"
#include "ros/tf/tf_wait.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/ultrasound/image_lag.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;
using diagnostic_msgs::DiagnosticStatus;

constexpr unsigned kFrameQueue = 500;

geometry_msgs::Pose as_pose(const geometry_msgs::Transform& transform) {
  geometry_msgs::Pose pose;
  pose.position.x = transform.translation.x;
  pose.position.y = transform.translation.y;
  pose.position.z = transform.translation.z;
  pose.orientation = transform.rotation;
  return pose;
}

}  // namespace

ArrayPoses::ArrayPoses(const ::ros::NodeHandle& node, const FrameStreamOptions& options)
    : us_frame_(options.pose_frame),
      image_lag_(options.assembly.image_lag_s),
      tf_wait_s_(options.tf_wait_s),
      buffer_(::ros::Duration(kTfHistory_s), options.max_tf_gap_s),
      input_(buffer_, node) {}

void ArrayPoses::look_up(ReceivedFrame& frame, const ::ros::Time& deadline) const try {
  const ::ros::Time stamp = frame.message->header.stamp;
  const ::ros::Time shown = stamp - image_lag_;
  // tf takes the time zero for the newest transform, which is not the pose of this frame.
  if (stamp.isZero() || shown.isZero()) return;
  // The deadline may be far away where the clock has run back.
  const double left_s = std::clamp(seconds_between(::ros::Time::now(), deadline), 0.0, tf_wait_s_);
  frame.set_looked_up(
      as_pose(wait_for_transform(buffer_, us_frame_, frame.frame_id, shown, left_s).transform),
      us_frame_);
} catch (const std::exception& error) {  // from tf2, or for a time out of range
  frame.pose_problem = error.what();
}

FrameStreamSource::FrameStreamSource(::ros::NodeHandle node, const FrameStreamOptions& options,
                                     VolumePublisher& volumes)
    : options_(options),
      volumes_(volumes),
      poses_(options.pose_frame.empty() ? nullptr
                                        : std::make_unique<const ArrayPoses>(node, options)),
      assembler_(options.assembly),
      last_arrival_(node),
      reported_at_(::ros::WallTime::now()),
      subscriber_(node.subscribe("us/frames", kFrameQueue, &FrameStreamSource::on_frame, this,
                                 ::ros::TransportHints().tcpNoDelay())),
      pause_timer_(
          node.createWallTimer(::ros::WallDuration(kPauseCheckPeriod_s),
                               guarded([this](const ::ros::WallTimerEvent&) { check_pause(); }))) {}

std::vector<EndedSweep> FrameStreamSource::assemble(const msg::PreScanFrame::ConstPtr& message,
                                                    const ::ros::Time& receipt) {
  std::shared_ptr<ReceivedFrame> frame;
  std::string problem;
  try {
    frame = from_message(message);
    require_not_ahead(message->header.stamp, ::ros::Time::now(), frame->name(), "header.stamp");
  } catch (const std::exception& error) {
    frame.reset();
    problem = error.what();
  }
  if (frame && frame->needs_pose()) {
    if (poses_)
      poses_->look_up(*frame, receipt + ::ros::Duration(options_.tf_wait_s));
    else
      frame->pose_problem = "the frames carry no pose, and the parameter pose_frame is not set";
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  --frames_in_work_;
  last_arrival_.set(::ros::Time::now());
  const std::int64_t now_ns = nanoseconds_from(last_arrival_.time());
  std::vector<EndedSweep> ended =
      frame ? assembler_.add(frame, now_ns) : assembler_.add_invalid(problem, now_ns);
  publish(ended);
  announce_recording();
  return ended;
}

void FrameStreamSource::on_frame(const ::ros::MessageEvent<msg::PreScanFrame const>& event) {
  {
    // While a frame waits for tf, a pause between frames is no pause of the sender.
    const std::lock_guard<std::mutex> lock(mutex_);
    ++frames_in_work_;
  }
  check_lags(assemble(event.getConstMessage(), event.getReceiptTime()));
}

void FrameStreamSource::check_pause() {
  std::vector<EndedSweep> ended;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (frames_in_work_ > 0) return;
    ended = assembler_.end_after_pause(nanoseconds_from(last_arrival_.now()));
    publish(ended);
  }
  check_lags(ended);
}

void FrameStreamSource::publish(const std::vector<EndedSweep>& sweeps) {
  for (const EndedSweep& sweep : sweeps) {
    const VolumePublisher::Id id = std::exchange(recording_id_, std::nullopt);
    refusal_ = sweep.assembled ? "" : sweep.message;
    if (!sweep.assembled) {
      ++refused_;
      ROS_ERROR("refused %s", sweep.message.c_str());
      volumes_.announce_refused(sweep.message, time_from(sweep.newest_ns), id);
      continue;
    }
    if (!sweep.message.empty())
      ROS_WARN("sweep %u: left out %s", sweep.number, sweep.message.c_str());
    ROS_INFO("sweep %u: %zu frames", sweep.number, sweep.assembled->frames.size());
    volumes_.publish(to_message(*sweep.assembled), id);
  }
}

void FrameStreamSource::announce_recording() {
  const auto open = assembler_.recording();
  if (!open || open->number == recording_number_) return;
  recording_number_ = open->number;
  recording_id_ = volumes_.announce_recording(time_from(open->since_ns));
}

void FrameStreamSource::check_lags(const std::vector<EndedSweep>& sweeps) {
  for (const EndedSweep& sweep : sweeps)
    if (sweep.assembled && !sweep.assembled->volume.geometry.is_motorised())
      check_lag(sweep.assembled->volume);
}

void FrameStreamSource::check_lag(const PreScanVolume& volume) {
  // The poses are already corrected by image_lag, so that the estimate is the remaining lag.
  const LagEstimate left = estimate_lag(volume);
  const double image_lag_s = options_.assembly.image_lag_s;
  const double lag_s = image_lag_s + left.lag_s;
  const double allowed_s = options_.lag_tolerance_s + 2.0 * left.standard_error_s;
  std::string text = "not determinable: " + left.message;
  std::string warning;
  if (left.determined)
    text = seconds_text(lag_s) + " s, standard error " + seconds_text(left.standard_error_s) + " s";
  if (left.determined && std::abs(left.lag_s) > allowed_s)
    warning = "images lag poses by " + text + ", but image_lag is " + seconds_text(image_lag_s) +
              " s" + ": frames are displaced along the sweep";
  if (!warning.empty()) ROS_WARN("%s", warning.c_str());
  const std::lock_guard<std::mutex> lock(mutex_);
  lag_ = text;
  lag_warning_ = warning;
}

void FrameStreamSource::describe(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!lag_warning_.empty()) status.mergeSummary(DiagnosticStatus::WARN, lag_warning_);
  if (!refusal_.empty()) status.mergeSummary(DiagnosticStatus::WARN, "refused " + refusal_);
  describe_frames(status);
  const std::string open = assembler_.open_sweep();
  status.add("recording", open.empty() ? "no" : open);
  status.add("sweeps refused", refused_);
  if (!assembler_.last_problem().empty()) status.add("last problem", assembler_.last_problem());
  status.add("image_lag [s]", options_.assembly.image_lag_s);
  if (!lag_.empty()) status.add("lag by the images", lag_);
}

void FrameStreamSource::describe_frames(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const ::ros::WallTime now = ::ros::WallTime::now();
  const double elapsed_s = std::max((now - reported_at_).toSec(), 1e-3);
  status.add("frames received", assembler_.received());
  status.add("frame rate [1/s]",
             static_cast<double>(assembler_.received() - reported_frames_) / elapsed_s);
  reported_at_ = now;
  reported_frames_ = assembler_.received();
  for (const auto& [reason, count] : assembler_.dropped()) status.add("dropped: " + reason, count);
}

}  // namespace usct::ros_interface
