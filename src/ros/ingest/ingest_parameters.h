#pragma once

#include <ros/node_handle.h>

#include <string>
#include <vector>

#include "ros/ingest/ultrasound_file.h"
#include "ros/node/parameters.h"
#include "us_ct_registration/io/ultrasound/ultrasound_source.h"
#include "us_ct_registration/ultrasound/image_sweep.h"
#include "us_ct_registration/ultrasound/sweep_assembly.h"
#include "us_ct_registration/ultrasound/tracked_images.h"

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
  double max_tf_gap_s = 0.0;
  double lag_tolerance_s = 0.0;
};

/// Live B-mode images, whose poses are in tf.
struct ImageStreamOptions {
  ImageSweepOptions sweep;
  /// Size of the images, for which the placement and the calibration hold.
  int width = 0;
  int height = 0;
  /// As in TrackedImages.
  std::vector<std::uint8_t> shown;
  ImagePlacement placement;
  /// The tf frame that moves with the probe; empty: that of the images.
  std::string image_frame;
  /// Maps frame coordinates to that frame, mm.
  Eigen::Isometry3d T_image_frame = Eigen::Isometry3d::Identity();
  /// Whether services start and end a sweep; else pauses of the images separate sweeps.
  bool by_service = true;
  /// Name of the image transport: raw, compressed...
  std::string transport;
  /// The namespace in which its plugin keeps its parameters.
  std::string plugin_namespace;
  /// Longest sweep, for which poses are kept.
  double longest_sweep_s = 0.0;
  double tf_wait_s = 0.0;
  double max_tf_gap_s = 0.0;
  double lag_tolerance_s = 0.0;
};

/// Parameters of the node us_ingest; config/nodes/us_ingest.yaml explains each.
struct IngestParameters {
  /// "file", "folder", "frames" or "images"; the options of the other sources are not used.
  std::string source;
  FileOptions file;
  FolderOptions folder;
  FrameStreamOptions frames;
  ImageStreamOptions images;
  double diagnostic_period_s = 0.0;
};

/// Reads the parameters of live images. They are checked, and the files that they name are read,
/// only if `used`. `file` and `frames` are the parameters that images share with other sources.
/// Throws InputError.
ImageStreamOptions read_image_stream(Parameters& parameters, const FileOptions& file,
                                     const FrameStreamOptions& frames, bool used);

/// Throws InputError, naming the parameter, its value and the constraint.
IngestParameters read_ingest_parameters(const ::ros::NodeHandle& private_node);

}  // namespace usct::ros_interface
