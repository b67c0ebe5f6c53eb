#pragma once

#include <nodelet/nodelet.h>

#include <exception>
#include <memory>

#include "ros/guarded_queue.h"

namespace usct::ros_interface {

/// A node class as a nodelet: volumes pass to other nodelets of the same manager by pointer. If the
/// node cannot start, loading the nodelet fails with a message.
template <class Node>
class NodeletOf : public nodelet::Nodelet {
  void onInit() override {
    try {
      queue_ = std::make_unique<GuardedQueue>(getMTCallbackQueue());
      node_ = std::make_unique<Node>(with_queue(getMTNodeHandle(), *queue_),
                                     with_queue(getMTPrivateNodeHandle(), *queue_));
    } catch (const std::exception& error) {
      NODELET_FATAL("%s", error.what());
      throw;
    }
  }

  std::unique_ptr<GuardedQueue> queue_;
  std::unique_ptr<Node> node_;  // last: its callbacks are in the queue
};

}  // namespace usct::ros_interface
