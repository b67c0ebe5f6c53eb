#include "ros/ingest/ingest_parameters.h"

#include "ros/conversions/message_limit.h"
#include "ros/node/parameters.h"
#include "ros/tf/tf_buffer.h"
#include "us_ct_registration/error.h"

namespace usct::ros_interface {
namespace {

constexpr std::size_t kBytesPerMegabyte = 1000000;

void read_file(Parameters& parameters, FileOptions& file) {
  file.ultrasound = read_ultrasound_source(parameters);
  file.frame_id = parameters.frame("frame_id", "us");
  file.stamp =
      parameters.choice("file_stamp", "acquisition", {"acquisition", "reading"}) == "reading"
          ? FileStamp::kReading
          : FileStamp::kAcquisition;
}

void read_folder(Parameters& parameters, FolderOptions& folder) {
  folder.period_s = parameters.number("folder_period", 0.5, 0.01, 60.0);
  folder.settle_s = parameters.number("folder_settle", 1.0, 0.0, 60.0);
  folder.suffix = parameters.text("folder_suffix", "");
  folder.take_existing = parameters.flag("folder_existing", false);
}

void read_frames(Parameters& parameters, FrameStreamOptions& frames) {
  AssemblyOptions& assembly = frames.assembly;
  assembly.sweep_pause_s = parameters.number("sweep_pause", 1.0, 0.1, 60.0);
  assembly.max_missing = parameters.number("max_missing", 0.1, 0.0, 0.9);
  assembly.max_frames = parameters.whole("max_frames", 2000, 2, 1000000);
  constexpr int kMostMegabytes = static_cast<int>(kMostMessageBytes / kBytesPerMegabyte);
  assembly.max_bytes = kBytesPerMegabyte * static_cast<std::size_t>(parameters.whole(
                                               "max_volume_mb", kMostMegabytes, 1, kMostMegabytes));
  assembly.image_lag_s = parameters.number("image_lag", 0.0, -2.0, 2.0);
  frames.pose_frame = parameters.frame("pose_frame", "");
  frames.tf_wait_s = parameters.number("tf_wait", 0.5, 0.0, 10.0);
  frames.max_tf_gap_s = parameters.number("max_tf_gap", kMaxTfGap_s, 0.0, 600.0);
  frames.lag_tolerance_s = parameters.number("lag_tolerance", 0.05, 0.0, 2.0);
}

}  // namespace

IngestParameters read_ingest_parameters(const ::ros::NodeHandle& private_node) {
  Parameters parameters(private_node);
  IngestParameters all;
  all.source = parameters.choice("source", "frames", {"file", "folder", "frames", "images"});
  read_file(parameters, all.file);
  read_folder(parameters, all.folder);
  read_frames(parameters, all.frames);
  all.images = read_image_stream(parameters, all.file, all.frames, all.source == "images");
  all.images.plugin_namespace = private_node.getNamespace();
  all.diagnostic_period_s = read_diagnostic_period(parameters);
  parameters.finish();
  const bool from_disk = all.source == "file" || all.source == "folder";
  const bool has_path = !all.file.ultrasound.path.empty();
  if (from_disk && !has_path)
    throw InputError(private_node.resolveName("path"),
                     "is empty, must name the " + all.source + " (source is '" + all.source + "')");
  if (!from_disk && has_path)
    throw InputError(private_node.resolveName("path"),
                     "is set, must be empty where source is '" + all.source + "'");
  if (from_disk && all.file.frame_id.empty())
    throw InputError(private_node.resolveName("frame_id"), "is empty, must name a frame");
  return all;
}

}  // namespace usct::ros_interface
