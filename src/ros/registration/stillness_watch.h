#pragma once

#include <chrono>
#include <future>
#include <list>

#include "ros/tf/fixed_frame.h"

namespace usct::ros_interface {

/// Judges whether the probe stood still around the stamps of volumes, as soon as tf tells it: tf
/// forgets, and a volume may be registered long after it arrived. Not to be used by several threads
/// at once.
class StillnessWatch {
 public:
  using Clock = std::chrono::steady_clock;

  explicit StillnessWatch(const FixedFrame& frame) : frame_(frame) {}

  /// The judgement of a volume, which comes at `deadline` at the latest: whether tf has reached the
  /// end of the window in which the probe must be still, so that a motion would have been seen, or
  /// the Refusal of FixedFrame::require_still.
  std::shared_future<bool> judgement_of(const std_msgs::Header& us, const FixedPose& pose,
                                        Clock::time_point deadline);
  /// Must be called often while there are volumes that wait.
  void judge();
  bool is_waiting() const { return !waiting_.empty(); }

 private:
  struct Waiting {
    std_msgs::Header us;
    FixedPose pose;
    Clock::time_point deadline;
    std::promise<bool> judgement;
  };

  const FixedFrame& frame_;
  std::list<Waiting> waiting_;
};

}  // namespace usct::ros_interface
