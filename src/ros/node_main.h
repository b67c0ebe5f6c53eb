#pragma once

#include <ros/ros.h>

#include <exception>

namespace usct::ros_interface {

/// Runs a node class until shutdown; ends with status 2 and a message if it cannot start. Its
/// callbacks come from several threads, so that a cancel is heard while a registration runs.
template <class Node>
int run_node(int argc, char** argv, const char* name) {
  ::ros::init(argc, argv, name);
  // They outlive the try: without any, ROS shuts down, and the message would be lost.
  ::ros::NodeHandle node;
  ::ros::NodeHandle private_node("~");
  try {
    constexpr unsigned kThreads = 4;
    ::ros::AsyncSpinner spinner(kThreads);
    Node instance(node, private_node);
    spinner.start();
    ::ros::waitForShutdown();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 2;
  }
  return 0;
}

}  // namespace usct::ros_interface
