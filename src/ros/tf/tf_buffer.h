#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/time.h>
#include <tf2/buffer_core.h>

#include <mutex>
#include <string>
#include <vector>

#include "ros/tf/tf_gaps.h"

namespace usct::ros_interface {

/// For so long the nodes remember poses, s: as long as a slow sweep takes, of which each frame is
/// looked up when the sweep has ended.
constexpr double kTfHistory_s = 60.0;
/// Over so long a time a pose is interpolated where there is a choice, s.
constexpr double kMaxTfGap_s = 0.5;

/// A tf2 buffer that knows when tf was silent. tf2 itself interpolates between two transforms
/// however far apart they are: after an interruption of the tracking it would give poses at which
/// the probe never was. May be called from any thread.
class TfBuffer {
 public:
  /// A transform is not known at a stamp that lies between two transforms of one of its frames with
  /// more than `max_gap_s` between them, unless the two are the same within 1 mm and 0.01 rad: a
  /// frame that does not move may be sent seldom. 0: tf2 interpolates over any time.
  explicit TfBuffer(
      const ::ros::Duration& history = ::ros::Duration(tf2::BufferCore::DEFAULT_CACHE_TIME),
      double max_gap_s = 0.0);

  /// Returns whether the transform was taken. `sender` is for messages of tf2.
  bool set_transform(const geometry_msgs::TransformStamped& transform, const std::string& sender,
                     bool is_static = false);
  void clear();

  /// The frame from which a frame hangs at the stamp; empty if that is not known.
  std::string parent_of(const std::string& frame, const ::ros::Time& stamp) const;
  /// Whether the transform from `source` to `target` is known at the stamp; 0: at any. If not,
  /// `why_not` says so.
  bool can_transform(const std::string& target, const std::string& source, const ::ros::Time& stamp,
                     std::string* why_not = nullptr) const;
  /// The transform from `source` to `target` at the stamp; 0: the newest. Throws
  /// tf2::TransformException where it is not known.
  geometry_msgs::TransformStamped look_up(const std::string& target, const std::string& source,
                                          const ::ros::Time& stamp) const;

 private:
  std::vector<std::string> with_ancestors(std::string frame, const ::ros::Time& stamp) const;
  bool stood_still(const std::string& frame, const std::string& parent, const TfGap& gap) const;
  std::string gap_at(const std::string& target, const std::string& source,
                     const ::ros::Time& stamp) const;

  const double max_gap_s_;
  // Both are changed and read together: a transform that ends a gap must not be used before the gap
  // is known.
  mutable std::mutex mutex_;
  tf2::BufferCore tf_;
  TfGaps gaps_;
};

}  // namespace usct::ros_interface
