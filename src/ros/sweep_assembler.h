#pragma once

#include <geometry_msgs/Pose.h>
#include <ros/time.h>
#include <us_ct_registration/PreScanFrame.h>
#include <us_ct_registration/PreScanVolume.h>

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace usct::ros_interface {

struct AssemblyOptions {
  /// A sweep ends when no frame has come for this long.
  double sweep_pause_s = 1.0;
  /// Largest share of a sweep's frames that may be missing.
  double max_missing = 0.1;
  /// Longer and larger sweeps are refused: frames, and bytes of brightness.
  int max_frames = 2000;
  std::size_t max_bytes = std::size_t{1} << 30;
  /// An image stamped t shows what the probe saw at t - lag.
  double image_lag_s = 0.0;
};

/// A frame as it came and, for tracked frames without a pose of their own, what tf said: the pose
/// of `header.frame_id` in `frame_id` at the stamp minus the image lag, or why there is none.
struct StreamedFrame {
  us_ct_registration::PreScanFrame::ConstPtr frame;
  std::optional<geometry_msgs::Pose> tf_pose;
  std::string tf_frame_id;
  std::string tf_error;
};

/// Frames by the reason why they are not in a volume.
using Counts = std::map<std::string, std::uint64_t>;

/// A sweep that has ended.
struct EndedSweep {
  std::uint32_t number = 0;
  /// Empty if the sweep was refused.
  us_ct_registration::PreScanVolumePtr volume;
  /// Why it was refused; else what was dropped, or empty.
  std::string message;
};

/// Puts streamed frames together to volumes.
///
/// A sweep ends with its last frame if it says how many it has, with the first frame of another
/// number, or by a pause. Frames are sorted by index. Dropped, and counted by reason: frames that
/// are invalid; frames of a sweep that has ended ("late"); a second frame with the same index; an
/// image that equals the one before while the probe moved (captured video repeats frames; a blank
/// image is no repetition); a motorised frame at the angle of the one before (the motor rests);
/// tracked frames whose pose at the stamp minus the lag is not known. Indices that never came and
/// frames without a pose are missing.
///
/// A sweep is refused, with the reason, if more than `max_missing` of it are missing, if it exceeds
/// the limits, if geometry, sizes, frames or the motor's travel change within it, if stamps fall or
/// if the motor turns back.
///
/// Without lag the volume has each number as it came, bit by bit.
class SweepAssembler {
 public:
  explicit SweepAssembler(const AssemblyOptions& options);

  /// Returns the sweeps that ended with this frame, which came at `now`. Time that runs backwards
  /// (a bag that starts anew) forgets everything.
  std::vector<EndedSweep> add(const StreamedFrame& frame, const ::ros::Time& now);
  /// Returns the sweep that a pause has ended.
  std::vector<EndedSweep> end_after_pause(const ::ros::Time& now);

  std::uint64_t received() const { return received_; }
  /// Frames that were dropped or are missing, by reason.
  const Counts& dropped() const { return dropped_; }
  /// What was wrong with the last invalid frame, or why the last one had no pose.
  const std::string& last_problem() const { return last_problem_; }

 private:
  struct Sweep {
    us_ct_registration::PreScanFrame::ConstPtr first;
    std::map<std::uint32_t, StreamedFrame> frames;  // by index
    std::size_t bytes = 0;
    std::size_t without_pose = 0;
    std::string pose_problem;
    ::ros::Time newest_stamp;
  };
  struct Ended {
    std::uint32_t number;
    bool had_first_index;
    ::ros::Time newest_stamp;
  };

  bool is_late(const us_ct_registration::PreScanFrame& frame);
  std::string refusal_of(const us_ct_registration::PreScanFrame& frame) const;
  void store(const StreamedFrame& frame);
  bool is_complete() const;
  EndedSweep end(const std::string& refusal = {});
  void require_few_missing(const Sweep& sweep, Counts& dropped, const std::string& source) const;
  void drop(const std::string& reason, std::uint64_t count = 1);

  AssemblyOptions options_;
  std::optional<Sweep> sweep_;
  std::deque<Ended> ended_;
  ::ros::Time last_arrival_;
  std::uint64_t received_ = 0;
  Counts dropped_;
  std::string last_problem_;
};

}  // namespace usct::ros_interface
