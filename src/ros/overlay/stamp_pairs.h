#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <algorithm>
#include <cstddef>
#include <deque>
#include <optional>

namespace usct::ros_interface {

/// Pairs images and camera_infos of the same stamp. The newest of each wait for their partner. When
/// stamps run back (a recording that is played again, a clock that is put right), nothing waits
/// any longer: what came before would else be taken for newer than all that follows.
class StampPairs {
 public:
  struct Pair {
    sensor_msgs::ImageConstPtr image;
    sensor_msgs::CameraInfoConstPtr info;
  };

  /// So many of each wait at most; >= 1.
  StampPairs(std::size_t images, std::size_t infos) : images_{images}, infos_{infos} {}

  std::optional<Pair> add(const sensor_msgs::ImageConstPtr& image) {
    const auto info = partner_of(image, images_, infos_);
    if (!info) return std::nullopt;
    return Pair{image, *info};
  }
  std::optional<Pair> add(const sensor_msgs::CameraInfoConstPtr& info) {
    const auto image = partner_of(info, infos_, images_);
    if (!image) return std::nullopt;
    return Pair{*image, info};
  }

 private:
  template <typename Message>
  struct Waiting {
    std::size_t most;
    std::deque<Message> messages{};
    ::ros::Time newest{};  // stamp of the last one that came, whether it waits or not
  };

  /// The message of the other kind with this stamp; this one waits if there is none yet.
  template <typename Message, typename Other>
  std::optional<Other> partner_of(const Message& message, Waiting<Message>& own,
                                  Waiting<Other>& other) {
    const ::ros::Time& stamp = message->header.stamp;
    if (stamp < own.newest) {
      own = {own.most};
      other = {other.most};
    }
    own.newest = stamp;
    const auto found =
        std::find_if(other.messages.begin(), other.messages.end(),
                     [&](const Other& waiting) { return waiting->header.stamp == stamp; });
    if (found != other.messages.end()) {
      const Other partner = *found;
      other.messages.erase(other.messages.begin(), found + 1);
      return partner;
    }
    own.messages.push_back(message);
    if (own.messages.size() > own.most) own.messages.pop_front();
    return std::nullopt;
  }

  Waiting<sensor_msgs::ImageConstPtr> images_;
  Waiting<sensor_msgs::CameraInfoConstPtr> infos_;
};

}  // namespace usct::ros_interface
