#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/ros.h>

#include <mutex>
#include <string>
#include <vector>

#include "ros/eventually.h"

namespace usct::ros_interface {

/// The messages of a topic, in the order of arrival.
template <typename Message>
class Inbox {
 public:
  Inbox(::ros::NodeHandle& node, const std::string& topic)
      : subscriber_(
            node.subscribe<Message>(topic, 100, [this](const typename Message::ConstPtr& m) {
              const std::lock_guard<std::mutex> lock(mutex_);
              messages_.push_back(m);
            })) {}

  std::vector<typename Message::ConstPtr> all() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }
  bool wait(std::size_t count) const {
    return eventually([&] { return all().size() >= count; });
  }
  /// The topic is latched: of messages that were sent before the connection only the last arrives.
  bool wait_for_publisher() const {
    return eventually([&] { return subscriber_.getNumPublishers() > 0; });
  }

 private:
  mutable std::mutex mutex_;
  std::vector<typename Message::ConstPtr> messages_;
  ::ros::Subscriber subscriber_;  // last: its callback uses the others
};

/// Whether diagnostics show `text` in a status of `node` with this level.
inline bool wait_for_diagnostics(const Inbox<diagnostic_msgs::DiagnosticArray>& inbox,
                                 const std::string& node, int level, const std::string& text) {
  return eventually([&] {
    for (const auto& message : inbox.all())
      for (const auto& status : message->status)
        if (status.name.find(node) != std::string::npos && status.level == level &&
            status.message.find(text) != std::string::npos)
          return true;
    return false;
  });
}

}  // namespace usct::ros_interface
