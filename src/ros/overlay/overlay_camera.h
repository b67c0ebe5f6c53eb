#pragma once

#include <image_transport/image_transport.h>
#include <image_transport/subscriber_filter.h>
#include <message_filters/subscriber.h>
#include <ros/ros.h>

#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "ros/overlay/newest_slot.h"
#include "ros/overlay/overlay_painter.h"
#include "ros/overlay/stamp_pairs.h"

namespace usct::ros_interface {

struct OverlayCameraOptions {
  std::string input;             // topic of the images; camera_info lies beside it
  std::string left;              // of the right camera of a pair: that of the left one; else empty
  std::string output;            // topic of the images with the overlay
  std::string transport;         // of image_transport, like raw
  std::string plugin_namespace;  // where the transport's plugin keeps its parameters
};

/// Counts of a camera's images since the node started, for the diagnostics.
struct OverlayCameraReport {
  bool is_subscribed = false;
  std::uint64_t received = 0;
  std::uint64_t published = 0;
  std::uint64_t drawn = 0;
  std::uint32_t dropped = 0;
  double latency_s = 0.0;          // of the newest image
  double longest_latency_s = 0.0;  // since the report before
  us_ct_registration::OverlayStatus status;
};

/// One camera: its images, the thread that draws into them, and what is published. While that
/// thread draws, only the newest image waits. Images are subscribed to only while somebody
/// subscribes to what is published.
class OverlayCamera {
 public:
  /// Makes the job of an image complete, with what only the node knows: how the camera is used, and
  /// warnings. Called before each image is drawn; may leave `info` empty, with the reason.
  using Completion = std::function<void(OverlayJob&)>;
  using Publication = std::function<void(const us_ct_registration::OverlayStatus&)>;

  /// `painter`, and what the functions use, must outlive the camera.
  OverlayCamera(const ::ros::NodeHandle& node, OverlayCameraOptions options, OverlayPainter painter,
                Completion complete, Publication publish_status);
  ~OverlayCamera();
  OverlayCamera(const OverlayCamera&) = delete;
  OverlayCamera& operator=(const OverlayCamera&) = delete;

  /// Ends the thread, so that the functions are called no more.
  void stop();

  /// The newest camera_info of the left camera, whoever looks at its images; null if there is none.
  sensor_msgs::CameraInfoConstPtr left_info() const;
  /// Whether images are received.
  bool is_subscribed() const;
  /// The stamps of the newest images, oldest first.
  std::deque<::ros::Time> newest_stamps() const;
  OverlayCameraReport report();

 private:
  void connect_or_disconnect();
  void take_image(const sensor_msgs::ImageConstPtr& image);
  void require_transport() const;
  void take_info(const sensor_msgs::CameraInfoConstPtr& info);
  void draw(const StampPairs::Pair& pair);
  std::string why_no_info() const;
  void work();
  void publish(const OverlayJob& job, const Overlay& overlay);

  const OverlayCameraOptions options_;
  ::ros::NodeHandle node_;
  std::string image_topic_;
  std::string info_topic_;
  image_transport::ImageTransport input_transport_;
  image_transport::ImageTransport output_transport_;
  const Completion complete_;
  const Publication publish_status_;
  OverlayPainter painter_;
  NewestSlot<OverlayJob> newest_;

  mutable std::mutex mutex_;  // guards the members below, up to report_
  sensor_msgs::CameraInfoConstPtr info_;
  sensor_msgs::CameraInfoConstPtr left_info_;
  std::deque<::ros::Time> stamps_;
  StampPairs pairs_;
  int without_info_ = 0;  // images since the last one that had a camera_info with its stamp
  OverlayCameraReport report_;

  std::mutex connecting_;
  image_transport::CameraPublisher publisher_;
  image_transport::SubscriberFilter images_;
  message_filters::Subscriber<sensor_msgs::CameraInfo> infos_;
  message_filters::Subscriber<sensor_msgs::CameraInfo> left_infos_;
  std::thread thread_;  // last: it uses the members above
};

}  // namespace usct::ros_interface
