#pragma once

#include <ros/ros.h>

#include <exception>

#include "ros/guarded_queue.h"

namespace usct::ros_interface {

/// Runs a node class until shutdown, and returns the exit status: 2, after a message, if the node
/// cannot start. Callbacks run on several threads, so that a node receives a cancel while another
/// of its callbacks waits.
template <class Node>
int run_node(int argc, char** argv, const char* name) {
  ::ros::init(argc, argv, name);
  // The handles outlive the try block: ROS shuts down with the last of them, and the message below
  // would be lost.
  ::ros::NodeHandle node;
  ::ros::NodeHandle private_node("~");
  try {
    constexpr unsigned kThreads = 4;
    ::ros::AsyncSpinner spinner(kThreads);
    GuardedQueue queue(*node.getCallbackQueue());
    Node instance(with_queue(node, queue), with_queue(private_node, queue));
    spinner.start();
    ::ros::waitForShutdown();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 2;
  }
  return 0;
}

}  // namespace usct::ros_interface
