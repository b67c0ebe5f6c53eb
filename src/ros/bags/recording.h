#pragma once

#include <ros/message_traits.h>
#include <rosbag/bag.h>

#include <boost/make_shared.hpp>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>

namespace usct::ros_interface {

/// Messages in the order of their time, as a recorder receives them.
class Recording {
 public:
  template <typename Message>
  void add(const std::string& topic, const ::ros::Time& time, const Message& message) {
    add(topic, time, message, {});
  }

  /// Adds a message that a player latches again, so that late subscribers receive it as well.
  template <typename Message>
  void add_latched(const std::string& topic, const ::ros::Time& time, const Message& message) {
    auto header = boost::make_shared<::ros::M_string>();
    (*header)["type"] = ::ros::message_traits::datatype(message);
    (*header)["md5sum"] = ::ros::message_traits::md5sum(message);
    (*header)["message_definition"] = ::ros::message_traits::definition(message);
    (*header)["callerid"] = "/usct_bag";
    (*header)["latching"] = "1";
    add(topic, time, message, header);
  }

  /// Throws std::runtime_error if the disk does not take all of it.
  void write(const std::filesystem::path& path) const {
    auto bag = std::make_unique<rosbag::Bag>(path.string(), rosbag::bagmode::Write);
    try {
      for (const auto& [time, write] : messages_) write(*bag);
      bag->close();
    } catch (const rosbag::BagException& error) {
      // The destructor would write what is left once more, and end the program as that fails too.
      static_cast<void>(bag.release());
      throw std::runtime_error(std::string("writing a bag failed: ") + error.what());
    }
  }

 private:
  template <typename Message>
  void add(const std::string& topic, const ::ros::Time& time, const Message& message,
           const boost::shared_ptr<::ros::M_string>& header) {
    auto shared = std::make_shared<const Message>(message);
    messages_.emplace(time, [=](rosbag::Bag& bag) { bag.write(topic, time, *shared, header); });
  }

  std::multimap<::ros::Time, std::function<void(rosbag::Bag&)>> messages_;
};

}  // namespace usct::ros_interface
