#pragma once

#include <nodelet/nodelet.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <exception>
#include <memory>

#include "ros/node/guarded_queue.h"

namespace usct::ros_interface {

/// A node class as a nodelet: volumes pass to other nodelets of the same manager by pointer. If the
/// node cannot start, loading the nodelet fails with a message.
///
/// The nodelet has callback threads of its own, as many as the node has in a process of its own
/// (`run_node`). On the manager's few threads, a callback that loads a CT or waits for tf would
/// hold up all other nodelets.
template <class Node>
class NodeletOf : public nodelet::Nodelet {
  void onInit() override {
    try {
      node_ = std::make_unique<Node>(with_queue(getNodeHandle(), guarded_),
                                     with_queue(getPrivateNodeHandle(), guarded_));
    } catch (const std::exception& error) {
      NODELET_FATAL("%s", error.what());
      throw;
    }
    constexpr unsigned kThreads = 4;
    spinner_ = std::make_unique<::ros::AsyncSpinner>(kThreads, &queue_);
    spinner_->start();
  }

  ::ros::CallbackQueue queue_;
  GuardedQueue guarded_{queue_};
  std::unique_ptr<Node> node_;
  // Last: it is destroyed first, and then no callback of the node runs any more.
  std::unique_ptr<::ros::AsyncSpinner> spinner_;
};

}  // namespace usct::ros_interface
