#include "ros/overlay/overlay_camera.h"

#include <image_transport/camera_common.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <utility>

#include "ros/node/guarded_queue.h"
#include "ros/node/resolved_topic.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

/// Images and camera_infos that wait for their partner of the same stamp. A camera_info comes from
/// the driver, while its image may be rectified or decoded first; it is small, and waits longer.
constexpr std::size_t kImages = 4;
constexpr std::size_t kInfos = 128;

}  // namespace

OverlayCamera::OverlayCamera(const ::ros::NodeHandle& node, OverlayCameraOptions options,
                             OverlayPainter painter, Completion complete,
                             Publication publish_status)
    : options_(std::move(options)),
      node_(node),
      image_topic_(node_.resolveName(options_.input)),
      info_topic_(image_transport::getCameraInfoTopic(image_topic_)),
      input_transport_(node_for_resolved(node_, image_topic_)),
      output_transport_(node_),
      complete_(std::move(complete)),
      publish_status_(std::move(publish_status)),
      painter_(std::move(painter)),
      pairs_(kImages, kInfos) {
  require_transport();
  images_.registerCallback(&OverlayCamera::take_image, this);
  infos_.registerCallback(&OverlayCamera::take_info, this);
  left_infos_.registerCallback([this](const sensor_msgs::CameraInfoConstPtr& info) {
    const std::lock_guard lock(mutex_);
    left_info_ = info;
  });
  const auto images_change = [this](const image_transport::SingleSubscriberPublisher&) {
    connect_or_disconnect();
  };
  const auto infos_change = [this](const ::ros::SingleSubscriberPublisher&) {
    connect_or_disconnect();
  };
  {
    // Subscribers may come before the publisher is assigned.
    const std::lock_guard lock(connecting_);
    publisher_ = output_transport_.advertiseCamera(options_.output, 1, images_change, images_change,
                                                   infos_change, infos_change);
  }
  thread_ = std::thread(&OverlayCamera::work, this);
}

OverlayCamera::~OverlayCamera() {
  publisher_.shutdown();
  images_.unsubscribe();
  infos_.unsubscribe();
  left_infos_.unsubscribe();
  stop();
}

void OverlayCamera::stop() {
  newest_.close();
  if (thread_.joinable()) thread_.join();
}

void OverlayCamera::require_transport() const {
  const std::vector<std::string> installed = output_transport_.getDeclaredTransports();
  std::string names;
  for (const std::string& name : installed) {
    if (name == "image_transport/" + options_.transport) return;
    names += (names.empty() ? "" : ", ") + name;
  }
  throw InputError(
      "image_transport",
      "is '" + options_.transport + "', for which no plugin is installed; there are: " + names);
}

void OverlayCamera::connect_or_disconnect() {
  const std::lock_guard lock(connecting_);
  const bool is_wanted = publisher_.getNumSubscribers() > 0;
  {
    const std::lock_guard state(mutex_);
    if (is_wanted == report_.is_subscribed) return;
    report_.is_subscribed = is_wanted;
    without_info_ = 0;
  }
  if (is_wanted) {
    infos_.subscribe(node_, info_topic_, kInfos);
    if (!options_.left.empty())
      left_infos_.subscribe(
          node_, image_transport::getCameraInfoTopic(node_.resolveName(options_.left)), 1);
    images_.subscribe(input_transport_, image_topic_, 1,
                      image_transport::TransportHints(
                          options_.transport, {}, ::ros::NodeHandle(options_.plugin_namespace)));
  } else {
    images_.unsubscribe();
    infos_.unsubscribe();
    left_infos_.unsubscribe();
    newest_.clear();
  }
}

void OverlayCamera::take_info(const sensor_msgs::CameraInfoConstPtr& info) {
  std::optional<StampPairs::Pair> pair;
  {
    const std::lock_guard lock(mutex_);
    info_ = info;
    pair = pairs_.add(info);
    if (pair) without_info_ = 0;
  }
  if (pair) draw(*pair);
}

std::string OverlayCamera::why_no_info() const {
  if (!info_) return "no camera_info on " + info_topic_;
  return "no camera_info with the stamp of the image on " + info_topic_;
}

void OverlayCamera::take_image(const sensor_msgs::ImageConstPtr& image) {
  // The video goes on without a camera_info, but an image whose camera_info is late must not be
  // taken for one that has none.
  constexpr int kMostWithoutInfo = static_cast<int>(kImages);
  constexpr std::size_t kStamps = 8;
  OverlayJob job;
  std::optional<StampPairs::Pair> pair;
  {
    const std::lock_guard lock(mutex_);
    ++report_.received;
    stamps_.push_back(image->header.stamp);
    if (stamps_.size() > kStamps) stamps_.pop_front();
    pair = pairs_.add(image);
    without_info_ = pair ? 0 : without_info_ + 1;
    if (!pair && without_info_ <= kMostWithoutInfo) return;
    job.problem = why_no_info();
  }
  if (pair) return draw(*pair);
  job.image = image;
  job.received = ::ros::WallTime::now();
  newest_.put(std::move(job));
}

void OverlayCamera::draw(const StampPairs::Pair& pair) {
  OverlayJob job;
  job.image = pair.image;
  job.info = pair.info;
  job.received = ::ros::WallTime::now();
  newest_.put(std::move(job));
}

void OverlayCamera::work() {
  while (std::optional<OverlayJob> job = newest_.take()) {
    try {
      complete_(*job);
      publish(*job, painter_.paint(*job));
    } catch (const std::exception& error) {
      log_escaped("the drawing of an overlay", error);
    }
  }
}

void OverlayCamera::publish(const OverlayJob& job, const Overlay& overlay) {
  us_ct_registration::OverlayStatus status = overlay.status;
  if (overlay.image) {
    auto info = job.info ? boost::make_shared<sensor_msgs::CameraInfo>(*job.info)
                         : boost::make_shared<sensor_msgs::CameraInfo>();
    info->header.stamp = job.image->header.stamp;
    if (!job.info) info->header.frame_id = job.image->header.frame_id;
    publisher_.publish(overlay.image, info);
  } else {
    ROS_ERROR_THROTTLE(1.0, "%s: %s", image_topic_.c_str(), status.message.c_str());
  }
  status.latency = (::ros::WallTime::now() - job.received).toSec();
  status.dropped = newest_.dropped();
  publish_status_(status);
  const std::lock_guard lock(mutex_);
  report_.published += overlay.image ? 1 : 0;
  report_.drawn += status.state == us_ct_registration::OverlayStatus::NOTHING ? 0 : 1;
  report_.dropped = status.dropped;
  report_.latency_s = status.latency;
  report_.longest_latency_s = std::max(report_.longest_latency_s, status.latency);
  report_.status = std::move(status);
}

sensor_msgs::CameraInfoConstPtr OverlayCamera::left_info() const {
  const std::lock_guard lock(mutex_);
  return left_info_;
}

bool OverlayCamera::is_subscribed() const {
  const std::lock_guard lock(mutex_);
  return report_.is_subscribed;
}

std::deque<::ros::Time> OverlayCamera::newest_stamps() const {
  const std::lock_guard lock(mutex_);
  return stamps_;
}

OverlayCameraReport OverlayCamera::report() {
  const std::lock_guard lock(mutex_);
  OverlayCameraReport report = report_;
  report_.longest_latency_s = 0.0;
  return report;
}

}  // namespace usct::ros_interface
