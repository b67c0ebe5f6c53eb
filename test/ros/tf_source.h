#pragma once

#include <gtest/gtest.h>
#include <ros/ros.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "ros/eventually.h"

namespace usct::ros_interface {

/// Sends poses on tf once the nodes under test listen, given by their full names (of nodelets: that
/// of their manager). A message that is sent before a node has connected never reaches it, and the
/// number of listeners does not tell which of the nodes have.
class TfSource {
 public:
  TfSource(::ros::NodeHandle& node, std::set<std::string> listeners)
      : listeners_(std::move(listeners)),
        publisher_(node.advertise<tf2_msgs::TFMessage>(
            "/tf", 1000, [this](const ::ros::SingleSubscriberPublisher& subscriber) {
              const std::lock_guard<std::mutex> lock(mutex_);
              connected_.insert(subscriber.getSubscriberName());
            })) {
    // A node that hears late of the end of one publisher drops its connection to the next one of
    // the same process, with what is sent meanwhile. So one publisher stays, as a robot's does.
    static const auto* const kept =
        new ::ros::Publisher(node.advertise<tf2_msgs::TFMessage>("/tf", 1000));
    static_cast<void>(kept);
  }

  void publish(const tf2_msgs::TFMessage& poses) const {
    EXPECT_TRUE(eventually([&] { return is_heard(); })) << "not all nodes listen to tf";
    publisher_.publish(poses);
  }

 private:
  bool is_heard() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::includes(connected_.begin(), connected_.end(), listeners_.begin(),
                         listeners_.end());
  }

  const std::set<std::string> listeners_;
  mutable std::mutex mutex_;
  std::set<std::string> connected_;
  ::ros::Publisher publisher_;  // last: its callback uses the others
};

}  // namespace usct::ros_interface
