#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include <memory>
#include <string>

#include "ros/ingest/ingest_parameters.h"
#include "ros/ingest/ingest_source.h"
#include "ros/ingest/volume_publisher.h"

namespace usct::ros_interface {

/// Reads ultrasound from a file, a watched folder, streamed frames or live images and publishes it
/// as volumes, see VolumePublisher. docs/nodes/us_ingest.md has topics, parameters and behaviours.
class UsIngest {
 public:
  /// Throws InputError for a parameter that is unknown or out of range, and for a file or folder
  /// that cannot be read.
  UsIngest(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);

 private:
  std::unique_ptr<IngestSource> make_source(const IngestParameters& parameters);
  void report(diagnostic_updater::DiagnosticStatusWrapper& status);

  ::ros::NodeHandle node_;
  std::string source_name_;
  VolumePublisher volumes_;
  diagnostic_updater::Updater diagnostics_;
  // These members are last, because their callbacks use all others.
  std::unique_ptr<IngestSource> source_;
  ::ros::WallTimer diagnostics_timer_;
};

}  // namespace usct::ros_interface
