#pragma once

#include <ros/node_handle.h>

#include <deque>
#include <mutex>
#include <optional>
#include <string>

#include "ros/ingest/file_source.h"
#include "ros/ingest/ingest_parameters.h"
#include "ros/ingest/ingest_source.h"
#include "ros/ingest/volume_publisher.h"
#include "ros/ingest/watched_folder.h"

namespace usct::ros_interface {

/// Publishes each file that appears in a folder, once it is completely written and can be stamped,
/// in the order in which they were written. A file that cannot be read is reported, and the source
/// continues.
class FolderSource : public IngestSource {
 public:
  /// Throws InputError if the folder cannot be read.
  FolderSource(::ros::NodeHandle node, const FileOptions& file, const FolderOptions& folder,
               VolumePublisher& volumes);

  void describe(diagnostic_updater::DiagnosticStatusWrapper& status) override;

 private:
  void look();
  /// Publishes or reports the first file in line; returns false if it cannot be stamped yet.
  bool is_done_with_first();
  /// Sets one of the texts that the diagnostics show.
  void tell(std::string& what, const std::string& text);

  const FileOptions file_;
  VolumePublisher& volumes_;
  std::mutex looking_;  // guards the next four; held while files are read
  WatchedFolder folder_;
  std::deque<std::filesystem::path> in_line_;
  std::optional<FileVolume> next_;  // of the first file in line, if it was read and waits
  int taken_ = 0;
  const std::size_t passed_over_;
  std::mutex mutex_;          // guards the next three
  std::string file_error_;    // of the last file; empty if it was published
  std::string folder_error_;  // of the last look; empty if the folder could be read
  std::string awaited_;       // by the first file in line; empty if none waits
  ::ros::WallTimer timer_;    // last: its callback uses all of the above
};

}  // namespace usct::ros_interface
