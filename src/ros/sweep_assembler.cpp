#include "ros/sweep_assembler.h"

#include <algorithm>
#include <boost/make_shared.hpp>
#include <cmath>
#include <limits>

#include "ros/conversions.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/ultrasound/image_lag.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

using Frames = std::vector<const StreamedFrame*>;

constexpr const char* kMissing = "missing";
constexpr const char* kWithoutPose = "without pose";
constexpr const char* kRepeatedImage = "repeated image";
/// Ended sweeps that late frames are told by.
constexpr std::size_t kRememberedSweeps = 16;
/// Shares of the mean step between frames: a motor that moves less rests; its travel within a frame
/// may differ by so much over a sweep.
constexpr double kRestingStep = 0.05;
constexpr double kTravelTolerance = 0.25;

bool is_motorised(const msg::PreScanFrame& frame) {
  return frame.geometry.type == msg::ProbeGeometry::MOTORISED_CURVILINEAR;
}

std::string name_of(const msg::PreScanFrame& frame) {
  return "sweep " + std::to_string(frame.sweep);
}

void validate_stamp(const msg::PreScanFrame& frame, double lag_s, const std::string& source) {
  const double shown_s = frame.header.stamp.toSec() - lag_s;
  if (frame.header.stamp.isZero() || shown_s <= 0.0 ||
      shown_s >= std::numeric_limits<std::uint32_t>::max())
    throw InputError(source, "'header.stamp' is " + std::to_string(frame.header.stamp.toSec()) +
                                 " s, must be the time of the acquisition, later than the image "
                                 "lag of " +
                                 std::to_string(lag_s) + " s");
}

void validate_frame(const StreamedFrame& streamed, double lag_s) {
  const msg::PreScanFrame& frame = *streamed.frame;
  const std::string source = name_of(frame) + " frame " + std::to_string(frame.index);
  validate(frame, source);
  validate_stamp(frame, lag_s, source);
  if (frame.frames_in_sweep > 0 && frame.index >= frame.frames_in_sweep)
    throw InputError(source, "'index' must be below 'frames_in_sweep', which is " +
                                 std::to_string(frame.frames_in_sweep));
  if (frame.header.frame_id.empty() && frame.pose_frame_id.empty())
    throw InputError(source, "'header.frame_id' is empty, must name the ultrasound's frame");
}

bool is_blank(const std::vector<std::uint8_t>& data) {
  return std::all_of(data.begin(), data.end(), [&](std::uint8_t v) { return v == data.front(); });
}

bool repeats_image(const Frames& frames, std::size_t i) {
  return i > 0 && frames[i]->frame->data == frames[i - 1]->frame->data &&
         !is_blank(frames[i]->frame->data);
}

/// What becomes of a sweep: the frames that stay, with the angles or poses that go with them.
struct Kept {
  Frames frames;
  std::vector<geometry_msgs::Pose> poses;  // tracked
  double travel_rad = 0.0;                 // motorised
  Counts dropped;
};

/// The travel within a frame, which a volume has once: the median.
double common_travel_rad(const Frames& frames, double mean_step_rad, const std::string& source) {
  std::vector<double> travels;
  for (const StreamedFrame* f : frames) travels.push_back(f->frame->motor_travel);
  std::sort(travels.begin(), travels.end());
  if (travels.back() - travels.front() > kTravelTolerance * mean_step_rad)
    throw InputError(source, "'motor_travel' changes from " + std::to_string(travels.front()) +
                                 " to " + std::to_string(travels.back()) +
                                 " rad, must be the same within a sweep");
  return travels[travels.size() / 2];
}

Kept keep_motorised(const Frames& frames, const std::string& source) {
  Kept kept;
  const auto angle = [](const StreamedFrame* f) { return f->frame->motor_angle; };
  const double way = angle(frames.back()) - angle(frames.front());
  const double mean_step = std::abs(way) / static_cast<double>(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const double step = kept.frames.empty() ? std::numeric_limits<double>::infinity()
                                            : (way < 0.0 ? -1.0 : 1.0) *
                                                  (angle(frames[i]) - angle(kept.frames.back()));
    if (step < -kRestingStep * mean_step)
      throw InputError(source, "the motor turns back at frame " +
                                   std::to_string(frames[i]->frame->index) + ", by " +
                                   std::to_string(-step) +
                                   " rad: each direction must be a sweep of its own");
    if (step <= kRestingStep * mean_step)
      ++kept.dropped["motor at rest"];
    else if (repeats_image(frames, i))
      ++kept.dropped[kRepeatedImage];
    else
      kept.frames.push_back(frames[i]);
  }
  kept.travel_rad = common_travel_rad(kept.frames, mean_step, source);
  return kept;
}

const geometry_msgs::Pose& pose_of(const StreamedFrame& frame) {
  return frame.tf_pose ? *frame.tf_pose : frame.frame->pose;
}

bool has_pose(const StreamedFrame& frame) {
  return frame.tf_pose || !frame.frame->pose_frame_id.empty();
}

/// Poses of the sweep's own, at each stamp minus the lag; none where they do not reach. Those of tf
/// were asked for at that time.
std::vector<std::optional<geometry_msgs::Pose>> poses_shown(const Frames& frames, double lag_s,
                                                            const std::string& source) {
  std::vector<std::optional<geometry_msgs::Pose>> poses;
  for (const StreamedFrame* f : frames) poses.emplace_back(pose_of(*f));
  if (lag_s == 0.0 || frames.front()->tf_pose) return poses;
  TrackedSweep track;
  const ::ros::Time start = frames.front()->frame->header.stamp;
  for (const StreamedFrame* f : frames) {
    track.T_us_frame.push_back(from_message_mm(f->frame->pose, source + ": 'pose'"));
    track.frame_times_s.push_back((f->frame->header.stamp - start).toSec());
  }
  const LagCorrected corrected = correct_image_lag(track, lag_s, source);
  poses.assign(frames.size(), std::nullopt);
  for (std::size_t k = 0; k < corrected.frames.size(); ++k)
    poses[static_cast<std::size_t>(corrected.frames[k])] =
        to_pose_message(corrected.sweep.T_us_frame[k]);
  return poses;
}

Kept keep_tracked(const Frames& all, double lag_s, const std::string& source) {
  Kept kept;
  Frames frames;
  for (const StreamedFrame* f : all)
    if (has_pose(*f)) frames.push_back(f);
  if (frames.empty()) throw InputError(source, "no frame has a pose");
  const auto poses = poses_shown(frames, lag_s, source);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!poses[i]) {
      ++kept.dropped["no pose at the stamp minus image_lag"];
    } else if (repeats_image(frames, i)) {
      ++kept.dropped[kRepeatedImage];
    } else {
      kept.frames.push_back(frames[i]);
      kept.poses.push_back(*poses[i]);
    }
  }
  if (kept.frames.empty()) throw InputError(source, "no image changes while a pose is known");
  return kept;
}

void require_rising_stamps(const Frames& frames, const std::string& source) {
  for (std::size_t i = 1; i < frames.size(); ++i)
    if (frames[i]->frame->header.stamp < frames[i - 1]->frame->header.stamp)
      throw InputError(source, "frame " + std::to_string(frames[i]->frame->index) +
                                   " is stamped before the frame with the index below: frames must "
                                   "be counted in the order of their acquisition");
}

msg::PreScanVolumePtr volume_of(const Kept& kept, double lag_s, const std::string& source) {
  auto volume = boost::make_shared<msg::PreScanVolume>();
  const msg::PreScanFrame& first = *kept.frames.front()->frame;
  volume->geometry = first.geometry;
  volume->samples = first.samples;
  volume->lines = first.lines;
  volume->frames = static_cast<std::uint32_t>(kept.frames.size());
  volume->data.reserve(kept.frames.size() * first.data.size());
  for (const StreamedFrame* f : kept.frames) {
    volume->frame_stamps.push_back(f->frame->header.stamp - ::ros::Duration(lag_s));
    if (is_motorised(first)) volume->frame_angles.push_back(f->frame->motor_angle);
    volume->data.insert(volume->data.end(), f->frame->data.begin(), f->frame->data.end());
  }
  volume->frame_travel = kept.travel_rad;
  volume->frame_poses = kept.poses;
  volume->header.stamp = volume->frame_stamps.back();
  volume->header.frame_id = is_motorised(first)            ? first.header.frame_id
                            : kept.frames.front()->tf_pose ? kept.frames.front()->tf_frame_id
                                                           : first.pose_frame_id;
  volume->crc32 = data_checksum(volume->data);
  from_message(*volume, source);  // throws if the frames do not make a volume
  return volume;
}

std::string described(const Counts& counts) {
  std::string text;
  for (const auto& [reason, count] : counts)
    text += (text.empty() ? "" : ", ") + std::to_string(count) + " " + reason;
  return text;
}

}  // namespace

SweepAssembler::SweepAssembler(const AssemblyOptions& options) : options_(options) {}

void SweepAssembler::drop(const std::string& reason, std::uint64_t count) {
  dropped_[reason] += count;
}

bool SweepAssembler::is_late(const msg::PreScanFrame& frame) {
  const auto ended = std::find_if(ended_.begin(), ended_.end(),
                                  [&](const Ended& e) { return e.number == frame.sweep; });
  if (ended == ended_.end()) return false;
  // A sender that starts anew may use the number again, from the first index on.
  const bool anew =
      frame.index == 0 && (ended->had_first_index || frame.header.stamp > ended->newest_stamp);
  if (!anew) return true;
  ended_.erase(ended);
  return false;
}

std::vector<EndedSweep> SweepAssembler::end_after_pause(const ::ros::Time& now) {
  if (!sweep_ || (now - last_arrival_).toSec() <= options_.sweep_pause_s) return {};
  return {end()};
}

std::vector<EndedSweep> SweepAssembler::add(const StreamedFrame& streamed, const ::ros::Time& now) {
  const msg::PreScanFrame& frame = *streamed.frame;
  ++received_;
  if (now < last_arrival_) {
    sweep_.reset();
    ended_.clear();
  }
  std::vector<EndedSweep> ended = end_after_pause(now);
  last_arrival_ = now;
  try {
    validate_frame(streamed, options_.image_lag_s);
  } catch (const InputError& error) {
    drop("invalid");
    last_problem_ = error.what();
    return ended;
  }
  const bool of_this_sweep = sweep_ && frame.sweep == sweep_->first->sweep;
  if (!of_this_sweep && is_late(frame)) {
    drop("late");
    return ended;
  }
  // A sender that starts anew counts from 0 again; the same frame sent twice has the same stamp.
  const bool anew = of_this_sweep && frame.index == 0 && sweep_->frames.count(0) > 0 &&
                    frame.header.stamp > sweep_->newest_stamp;
  if (sweep_ && (!of_this_sweep || anew)) {
    ended.push_back(end());
    if (anew) ended_.pop_back();
  }
  if (!sweep_) {
    sweep_ = Sweep();
    sweep_->first = streamed.frame;
  }
  const std::string refusal = refusal_of(frame);
  if (!refusal.empty()) {
    drop("of a refused sweep");
    ended.push_back(end(refusal));
    return ended;
  }
  store(streamed);
  if (is_complete()) ended.push_back(end());
  return ended;
}

std::string SweepAssembler::refusal_of(const msg::PreScanFrame& frame) const {
  const msg::PreScanFrame& first = *sweep_->first;
  const std::string at = " at frame " + std::to_string(frame.index);
  if (!(frame.geometry == first.geometry)) return "the geometry of the probe changes" + at;
  if (frame.samples != first.samples || frame.lines != first.lines)
    return "the size changes" + at + " from " + std::to_string(first.samples) + " x " +
           std::to_string(first.lines) + " to " + std::to_string(frame.samples) + " x " +
           std::to_string(frame.lines);
  if (frame.frames_in_sweep != first.frames_in_sweep)
    return "'frames_in_sweep' changes" + at + " from " + std::to_string(first.frames_in_sweep) +
           " to " + std::to_string(frame.frames_in_sweep);
  if (frame.header.frame_id != first.header.frame_id || frame.pose_frame_id != first.pose_frame_id)
    return "'header.frame_id' or 'pose_frame_id' changes" + at;
  const auto most = static_cast<std::uint32_t>(options_.max_frames);
  if (frame.frames_in_sweep > most || frame.index >= most)
    return "it has " + std::to_string(std::max(frame.frames_in_sweep, frame.index)) +
           " frames or more, max_frames is " + std::to_string(most);
  if (sweep_->bytes + frame.data.size() > options_.max_bytes)
    return "it is larger than " + std::to_string(options_.max_bytes) + " bytes (max_volume_mb)";
  return {};
}

void SweepAssembler::store(const StreamedFrame& streamed) {
  const msg::PreScanFrame& frame = *streamed.frame;
  if (!sweep_->frames.emplace(frame.index, streamed).second) {
    drop("same index");
    return;
  }
  sweep_->bytes += frame.data.size();
  sweep_->newest_stamp = std::max(sweep_->newest_stamp, frame.header.stamp);
  if (!is_motorised(frame) && !has_pose(streamed)) {
    ++sweep_->without_pose;
    sweep_->pose_problem = streamed.tf_error;
    last_problem_ = name_of(frame) + " frame " + std::to_string(frame.index) +
                    ": no pose: " + streamed.tf_error;
  }
}

bool SweepAssembler::is_complete() const {
  return sweep_->frames.size() == sweep_->first->frames_in_sweep;
}

EndedSweep SweepAssembler::end(const std::string& refusal) {
  const Sweep sweep = std::move(*sweep_);
  sweep_.reset();
  const std::string source = name_of(*sweep.first);
  EndedSweep result;
  result.number = sweep.first->sweep;
  ended_.push_back({result.number, sweep.frames.count(0) > 0, sweep.newest_stamp});
  if (ended_.size() > kRememberedSweeps) ended_.pop_front();
  if (!refusal.empty()) {
    drop("of a refused sweep", sweep.frames.size());
    result.message = source + ": " + refusal;
    return result;
  }
  Counts dropped;
  try {
    require_few_missing(sweep, dropped, source);
    Frames frames;
    for (const auto& [index, frame] : sweep.frames) frames.push_back(&frame);
    require_rising_stamps(frames, source);
    Kept kept = is_motorised(*sweep.first) ? keep_motorised(frames, source)
                                           : keep_tracked(frames, options_.image_lag_s, source);
    dropped.insert(kept.dropped.begin(), kept.dropped.end());
    result.message = described(dropped);
    result.volume = volume_of(kept, options_.image_lag_s, source);
  } catch (const InputError& error) {
    drop("of a refused sweep", sweep.frames.size());
    result.message = error.what();
  }
  for (const auto& [reason, count] : dropped) drop(reason, count);
  return result;
}

void SweepAssembler::require_few_missing(const Sweep& sweep, Counts& dropped,
                                         const std::string& source) const {
  const std::size_t expected = sweep.first->frames_in_sweep > 0
                                   ? sweep.first->frames_in_sweep
                                   : std::size_t{sweep.frames.rbegin()->first} + 1;
  const std::size_t missing = expected - sweep.frames.size();
  if (missing > 0) dropped[kMissing] = missing;
  if (sweep.without_pose > 0) dropped[kWithoutPose] = sweep.without_pose;
  const std::size_t lost = missing + sweep.without_pose;
  if (static_cast<double>(lost) <= options_.max_missing * static_cast<double>(expected)) return;
  const std::string poses = sweep.without_pose == 0
                                ? std::string()
                                : ", " + std::to_string(sweep.without_pose) +
                                      " of them for want of a pose (" + sweep.pose_problem + ")";
  throw InputError(source, std::to_string(lost) + " of " + std::to_string(expected) +
                               " frames are missing" + poses + "; max_missing is " +
                               std::to_string(options_.max_missing));
}

}  // namespace usct::ros_interface
