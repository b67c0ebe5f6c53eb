#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include <cstdint>
#include <exception>

namespace usct::ros_interface {

/// Hands callbacks on to another queue, so that an exception which one of them lets out is logged
/// and goes no further. ROS has no such net: an exception in a subscription or a timer ends the
/// process, and with nodelets all nodes of the manager.
class GuardedQueue : public ::ros::CallbackQueueInterface {
 public:
  /// `queue` must outlive this object.
  explicit GuardedQueue(::ros::CallbackQueueInterface& queue) : queue_(queue) {}

  void addCallback(const ::ros::CallbackInterfacePtr& callback, std::uint64_t owner_id) override;
  void removeByID(std::uint64_t owner_id) override { queue_.removeByID(owner_id); }

 private:
  ::ros::CallbackQueueInterface& queue_;
};

/// Says in the log that `what` was stopped by an exception.
void log_escaped(const char* what, const std::exception& error);

/// A timer's callback that logs what it would let out. A GuardedQueue is not enough for a timer:
/// ROS schedules it again only once its callback has returned.
template <typename Callback>
auto guarded(Callback callback) {
  return [callback](const auto& event) {
    try {
      callback(event);
    } catch (const std::exception& error) {
      log_escaped("a timer", error);
    }
  };
}

/// Waits until `queue`, which one other thread serves, has called all that it holds now, or until
/// ROS shuts down.
void wait_for_held(::ros::CallbackQueue& queue);

/// The node handle with another queue.
::ros::NodeHandle with_queue(::ros::NodeHandle node, ::ros::CallbackQueueInterface& queue);

}  // namespace usct::ros_interface
