#include "ros/ingest/us_ingest.h"

#include <std_msgs/Header.h>

#include "ros/conversions/times.h"
#include "ros/guarded_queue.h"
#include "ros/ingest/file_source.h"
#include "ros/ingest/folder_source.h"
#include "ros/ingest/frame_stream_source.h"
#include "ros/ingest/image_source.h"

namespace usct::ros_interface {
UsIngest::UsIngest(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node)
    : node_(node), diagnostics_(node, private_node, private_node.getNamespace()) {
  const IngestParameters parameters = read_ingest_parameters(private_node);
  source_name_ = parameters.source;
  header_publisher_ = node_.advertise<std_msgs::Header>("us/announced", 1, true);
  volume_publisher_ = node_.advertise<us_ct_registration::PreScanVolume>("us/volume", 1, true);
  source_ = make_source(parameters);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("ultrasound", this, &UsIngest::report);
  diagnostics_timer_ = node_.createWallTimer(
      ::ros::WallDuration(parameters.diagnostic_period_s),
      guarded([this](const ::ros::WallTimerEvent&) { diagnostics_.force_update(); }));
}

std::unique_ptr<IngestSource> UsIngest::make_source(const IngestParameters& parameters) {
  const PublishVolume publish_volume = [this](const auto& volume) { publish(volume); };
  if (parameters.source == "file")
    return std::make_unique<FileSource>(node_, parameters.file, publish_volume);
  if (parameters.source == "folder")
    return std::make_unique<FolderSource>(node_, parameters.file, parameters.folder,
                                          publish_volume);
  if (parameters.source == "images")
    return std::make_unique<ImageSource>(node_, parameters.images, publish_volume);
  return std::make_unique<FrameStreamSource>(node_, parameters.frames, publish_volume);
}

void UsIngest::publish(const us_ct_registration::PreScanVolumeConstPtr& volume) {
  const std::lock_guard<std::mutex> lock(mutex_);
  header_publisher_.publish(volume->header);
  volume_publisher_.publish(volume);
  ++published_;
  last_volume_stamp_ = volume->header.stamp;
}

void UsIngest::report(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using diagnostic_msgs::DiagnosticStatus;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    status.summary(DiagnosticStatus::OK,
                   published_ > 0 ? "volumes published" : "waiting for ultrasound");
    status.add("source", source_name_);
    status.add("volumes published", published_);
    if (published_ > 0)
      status.add("age of the last volume [s]",
                 seconds_between(last_volume_stamp_, ::ros::Time::now()));
  }
  source_->describe(status);
}

}  // namespace usct::ros_interface
