#include "ros/node/guarded_queue.h"

#include <ros/console.h>
#include <ros/init.h>

#include <boost/make_shared.hpp>
#include <chrono>
#include <future>

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

/// Says that its turn has come.
class Turn : public ::ros::CallbackInterface {
 public:
  CallResult call() override {
    come_.set_value();
    return Success;
  }
  std::future<void> come() { return come_.get_future(); }

 private:
  std::promise<void> come_;
};

}  // namespace

void GuardedQueue::addCallback(const ::ros::CallbackInterfacePtr& callback,
                               std::uint64_t owner_id) {
  queue_.addCallback(boost::make_shared<GuardedCallback>(callback), owner_id);
}

void wait_for_held(::ros::CallbackQueue& queue) {
  const auto turn = boost::make_shared<Turn>();
  const std::future<void> come = turn->come();
  queue.addCallback(turn);
  constexpr std::chrono::milliseconds kCheck{50};
  while (come.wait_for(kCheck) != std::future_status::ready && !::ros::isShuttingDown()) {
  }
}

::ros::NodeHandle with_queue(::ros::NodeHandle node, ::ros::CallbackQueueInterface& queue) {
  node.setCallbackQueue(&queue);
  return node;
}

void log_escaped(const char* what, const std::exception& error) {
  ROS_ERROR("%s ended with an error that it does not handle: %s", what, error.what());
}

}  // namespace usct::ros_interface
