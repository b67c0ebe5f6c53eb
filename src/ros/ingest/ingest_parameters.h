#pragma once

#include <ros/node_handle.h>

#include <string>

#include "ros/ingest/ultrasound_file.h"
#include "us_ct_registration/io/ultrasound/ultrasound_source.h"
#include "us_ct_registration/ultrasound/sweep_assembly.h"

namespace usct::ros_interface {

/// Options for reading and stamping files.
struct FileOptions {
  /// `path` is that of the file or the folder.
  UltrasoundSource ultrasound;
  std::string frame_id;
  FileStamp stamp = FileStamp::kAcquisition;
};

struct FolderOptions {
  double period_s = 0.0;
  double settle_s = 0.0;
  std::string suffix;
  bool take_existing = false;
};

struct FrameStreamOptions {
  AssemblyOptions assembly;
  /// The US frame in which tf knows the array of a tracked probe; empty: tf is not asked.
  std::string pose_frame;
  double tf_wait_s = 0.0;
  double lag_tolerance_s = 0.0;
};

/// Parameters of the node us_ingest; config/nodes/us_ingest.yaml explains each.
struct IngestParameters {
  /// "file", "folder" or "frames"; the options of the other sources are not used.
  std::string source;
  FileOptions file;
  FolderOptions folder;
  FrameStreamOptions frames;
  double diagnostic_period_s = 0.0;
};

/// Throws InputError, naming the parameter, its value and the constraint.
IngestParameters read_ingest_parameters(const ::ros::NodeHandle& private_node);

}  // namespace usct::ros_interface
