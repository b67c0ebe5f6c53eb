#include "ros/ingest/volume_publisher.h"

#include <us_ct_registration/Acquisition.h>

#include "ros/conversions/times.h"

namespace usct::ros_interface {

using us_ct_registration::Acquisition;

VolumePublisher::VolumePublisher(::ros::NodeHandle node)
    : announcements_(node.advertise<Acquisition>("us/announced", 1, true)),
      volumes_(node.advertise<us_ct_registration::PreScanVolume>("us/volume", 1, true)) {}

void VolumePublisher::announce(std::uint8_t state, const ::ros::Time& stamp,
                               const std::string& reason) {
  Acquisition acquisition;
  acquisition.header.stamp = stamp;
  acquisition.state = state;
  acquisition.reason = reason;
  announcements_.publish(acquisition);
}

void VolumePublisher::announce_recording(const ::ros::Time& first_stamp) {
  announce(Acquisition::RECORDING, first_stamp);
}

void VolumePublisher::publish(const us_ct_registration::PreScanVolumeConstPtr& volume) {
  const std::lock_guard<std::mutex> lock(mutex_);
  announce(Acquisition::RECORDED, volume->header.stamp);
  volumes_.publish(volume);
  ++published_;
  last_stamp_ = volume->header.stamp;
}

void VolumePublisher::announce_refused(const std::string& reason, const ::ros::Time& stamp) {
  const std::lock_guard<std::mutex> lock(mutex_);
  // Later than that of the volume before is all that has to be known.
  constexpr std::int32_t kNanosecond = 1;
  announce(Acquisition::REFUSED,
           stamp.isZero() ? last_stamp_ + ::ros::Duration(0, kNanosecond) : stamp, reason);
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
