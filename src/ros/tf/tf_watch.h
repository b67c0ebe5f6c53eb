#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/time.h>

#include <chrono>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace usct::ros_interface {

/// Listens to what others say in tf, in order to find out whether a transform that this node
/// broadcasts is disputed: tf itself uses whatever it received last and tells nobody.
///
/// Transforms are forgotten after the time for which listeners keep them by default, except static
/// ones, which listeners never forget. May be called from any thread.
class TfWatch {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kMemory{10};

  /// Remembers a transform that this node sends, and that `heard` will ignore: publishers of one
  /// process share a name, so that only the content tells them apart. Must be called before the
  /// transform is sent.
  void sent(const geometry_msgs::TransformStamped& transform);

  /// Takes a transform that `publisher`, a node's name, has sent.
  void heard(const geometry_msgs::TransformStamped& transform, const std::string& publisher,
             bool is_static, Clock::time_point now);

  /// Why the transform from `fixed_frame` to `ct_frame` must not be broadcast: another publisher
  /// sends it as well, the CT's frame has another parent, or there would be a loop. In words that
  /// name the frames and the publisher; empty if nothing is known against it.
  std::string conflict(const std::string& fixed_frame, const std::string& ct_frame,
                       Clock::time_point now) const;

 private:
  /// The last transform to a frame from another publisher.
  struct Heard {
    std::string parent;
    std::string publisher;
    bool is_static = false;
    Clock::time_point when;
  };

  /// By stamp and child frame.
  using Sent = std::map<std::pair<::ros::Time, std::string>, geometry_msgs::TransformStamped>;

  bool is_own(const geometry_msgs::TransformStamped& transform) const;
  const Heard* find(const std::string& child, Clock::time_point now) const;

  mutable std::mutex mutex_;
  // The last transforms that were sent, and those before. The older ones are dropped all at once,
  // because after a jump of time the stamps do not say which are older.
  Sent sent_;
  Sent sent_before_;
  std::map<std::string, Heard> heard_;  // by child frame
};

}  // namespace usct::ros_interface
