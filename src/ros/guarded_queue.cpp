#include "ros/guarded_queue.h"

#include <ros/console.h>

#include <boost/make_shared.hpp>

namespace usct::ros_interface {
namespace {

class GuardedCallback : public ::ros::CallbackInterface {
 public:
  explicit GuardedCallback(::ros::CallbackInterfacePtr callback) : callback_(std::move(callback)) {}

  CallResult call() override {
    try {
      return callback_->call();
    } catch (const std::exception& error) {
      log_escaped("a callback", error);
      return Invalid;
    }
  }
  bool ready() override { return callback_->ready(); }

 private:
  const ::ros::CallbackInterfacePtr callback_;
};

}  // namespace

void GuardedQueue::addCallback(const ::ros::CallbackInterfacePtr& callback,
                               std::uint64_t owner_id) {
  queue_.addCallback(boost::make_shared<GuardedCallback>(callback), owner_id);
}

::ros::NodeHandle with_queue(::ros::NodeHandle node, ::ros::CallbackQueueInterface& queue) {
  node.setCallbackQueue(&queue);
  return node;
}

void log_escaped(const char* what, const std::exception& error) {
  ROS_ERROR("%s ended with an error that it does not handle: %s", what, error.what());
}

}  // namespace usct::ros_interface
