#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <us_ct_registration/PreScanFrame.h>
#include <us_ct_registration/PreScanVolume.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "ros/parameters.h"
#include "ros/sweep_assembler.h"
#include "ros/ultrasound_file.h"
#include "ros/watched_folder.h"
#include "us_ct_registration/io/ultrasound/ultrasound_source.h"

namespace usct::ros_interface {

/// Reads ultrasound from a file, a watched folder or streamed frames and publishes it as volumes on
/// `us/volume` (latched). docs/nodes/us_ingest.md has topics, parameters and behaviours.
class UsIngest {
 public:
  /// Throws InputError for a parameter that is unknown or out of range, and for a file or folder
  /// that cannot be read.
  UsIngest(const ::ros::NodeHandle& node, const ::ros::NodeHandle& private_node);

 private:
  struct Options {
    std::string source;
    // File and folder.
    UltrasoundSource ultrasound;  // `path` is the file's or the folder's
    std::string frame_id;
    FileStamp file_stamp = FileStamp::kAcquisition;
    double folder_period_s = 0.0;
    double folder_settle_s = 0.0;
    std::string folder_suffix;
    bool folder_existing = false;
    // Frames.
    AssemblyOptions assembly;
    std::string pose_frame;
    double tf_wait_s = 0.0;
    double lag_tolerance_s = 0.0;
  };
  static Options read_options(const ::ros::NodeHandle& private_node);
  static void read_file_options(Parameters& parameters, Options& options);

  void on_frame(const ::ros::MessageEvent<us_ct_registration::PreScanFrame const>& event);
  void look_up_pose(StreamedFrame& frame, const ::ros::Time& receipt) const;
  void check_pause();
  void look_into_folder();
  void take_file(const std::filesystem::path& path);
  void publish(const us_ct_registration::PreScanVolumeConstPtr& volume);
  std::vector<us_ct_registration::PreScanVolumeConstPtr> publish(
      const std::vector<EndedSweep>& sweeps);
  void check_lag(const us_ct_registration::PreScanVolume& volume);
  void report(diagnostic_updater::DiagnosticStatusWrapper& status);

  const Options options_;
  ::ros::Publisher volume_publisher_;
  std::unique_ptr<tf2_ros::Buffer> tf_buffer_;
  std::unique_ptr<tf2_ros::TransformListener> tf_listener_;
  std::mutex folder_mutex_;
  std::optional<WatchedFolder> folder_;

  std::mutex mutex_;  // guards what follows
  SweepAssembler assembler_;
  int frames_in_work_ = 0;
  std::uint64_t published_ = 0;
  std::uint64_t refused_ = 0;
  std::string refusal_;     // of the last sweep; empty if it was published
  std::string file_error_;  // of the last file or of the folder; empty if it was published
  std::string lag_;         // what the last tracked sweep says of it
  std::string lag_warning_;
  ::ros::Time last_volume_stamp_;
  std::uint64_t reported_frames_ = 0;
  ::ros::WallTime reported_at_;

  diagnostic_updater::Updater diagnostics_;
  // Last, so that they end first: their callbacks use all of the above.
  ::ros::Subscriber frame_subscriber_;
  std::vector<::ros::WallTimer> timers_;
};

}  // namespace usct::ros_interface
