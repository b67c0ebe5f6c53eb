#include "ros/ingest/us_ingest.h"

#include "ros/ingest/file_source.h"
#include "ros/ingest/folder_source.h"
#include "ros/ingest/frame_stream_source.h"
#include "ros/ingest/image_source.h"
#include "ros/node/guarded_queue.h"

namespace usct::ros_interface {
UsIngest::UsIngest(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node)
    : node_(node), volumes_(node), diagnostics_(node, private_node, private_node.getNamespace()) {
  const IngestParameters parameters = read_ingest_parameters(private_node);
  source_name_ = parameters.source;
  source_ = make_source(parameters);
  diagnostics_.setHardwareID("none");
  diagnostics_.add("ultrasound", this, &UsIngest::report);
  diagnostics_timer_ = node_.createWallTimer(
      ::ros::WallDuration(parameters.diagnostic_period_s),
      guarded([this](const ::ros::WallTimerEvent&) { diagnostics_.force_update(); }));
}

std::unique_ptr<IngestSource> UsIngest::make_source(const IngestParameters& parameters) {
  if (parameters.source == "file")
    return std::make_unique<FileSource>(node_, parameters.file, volumes_);
  if (parameters.source == "folder")
    return std::make_unique<FolderSource>(node_, parameters.file, parameters.folder, volumes_);
  if (parameters.source == "images")
    return std::make_unique<ImageSource>(node_, parameters.images, volumes_);
  return std::make_unique<FrameStreamSource>(node_, parameters.frames, volumes_);
}

void UsIngest::report(diagnostic_updater::DiagnosticStatusWrapper& status) {
  volumes_.describe(status);
  status.add("source", source_name_);
  source_->describe(status);
}

}  // namespace usct::ros_interface
