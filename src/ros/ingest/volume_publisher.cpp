#include "ros/ingest/volume_publisher.h"

#include <us_ct_registration/Acquisition.h>

#include <algorithm>

#include "ros/conversions/times.h"

namespace usct::ros_interface {

using us_ct_registration::Acquisition;

VolumePublisher::VolumePublisher(::ros::NodeHandle node)
    : announcements_(node.advertise<Acquisition>("us/announced", 1, true)),
      volumes_(node.advertise<us_ct_registration::PreScanVolume>("us/volume", 1, true)) {}

std::uint64_t VolumePublisher::next_id() {
  last_id_ = std::max(last_id_ + 1, wall_time_ms());  // the clock may have been set back
  return last_id_;
}

void VolumePublisher::announce(std::uint8_t state, const ::ros::Time& stamp, std::uint64_t id,
                               const std::string& reason) {
  Acquisition acquisition;
  acquisition.header.stamp = stamp;
  acquisition.id = id;
  acquisition.state = state;
  acquisition.reason = reason;
  announcements_.publish(acquisition);
}

VolumePublisher::Id VolumePublisher::announce_recording(const ::ros::Time& first_stamp) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::uint64_t id = next_id();
  announce(Acquisition::RECORDING, first_stamp, id);
  return id;
}

void VolumePublisher::publish(const us_ct_registration::PreScanVolumeConstPtr& volume, Id id) {
  const std::lock_guard<std::mutex> lock(mutex_);
  announce(Acquisition::RECORDED, volume->header.stamp, id ? *id : next_id());
  volumes_.publish(volume);
  ++published_;
  last_stamp_ = volume->header.stamp;
}

void VolumePublisher::announce_refused(const std::string& reason, const ::ros::Time& stamp, Id id) {
  const std::lock_guard<std::mutex> lock(mutex_);
  announce(Acquisition::REFUSED, stamp.isZero() ? ::ros::Time::now() : stamp, id ? *id : next_id(),
           reason);
}

void VolumePublisher::describe(diagnostic_updater::DiagnosticStatusWrapper& status) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  status.summary(diagnostic_msgs::DiagnosticStatus::OK,
                 published_ > 0 ? "volumes published" : "waiting for ultrasound");
  status.add("volumes published", published_);
  if (published_ > 0)
    status.add("age of the last volume [s]", seconds_between(last_stamp_, ::ros::Time::now()));
}

}  // namespace usct::ros_interface
