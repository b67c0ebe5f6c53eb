#pragma once

#include <ros/node_handle.h>

#include <mutex>
#include <string>

#include "ros/ingest/ingest_parameters.h"
#include "ros/ingest/ingest_source.h"
#include "ros/ingest/watched_folder.h"

namespace usct::ros_interface {

/// Publishes each file that appears in a folder, once it is completely written. A file that cannot
/// be read is reported, and the source continues.
class FolderSource : public IngestSource {
 public:
  /// Throws InputError if the folder cannot be read.
  FolderSource(::ros::NodeHandle node, const FileOptions& file, const FolderOptions& folder,
               PublishVolume publish);

  void describe(diagnostic_updater::DiagnosticStatusWrapper& status) override;

 private:
  void look();
  void take(const std::filesystem::path& path);
  /// Names what files wait for before any can be stamped, in words; empty if they need not.
  std::string awaited_clock() const;
  void set_error(const std::string& error);

  const FileOptions file_;
  const PublishVolume publish_;
  std::mutex looking_;  // guards folder_ and taken_; held while files are read
  WatchedFolder folder_;
  int taken_ = 0;
  std::mutex mutex_;        // guards error_
  std::string error_;       // of the last file or the folder; empty if the last file was published
  ::ros::WallTimer timer_;  // last: its callback uses all of the above
};

}  // namespace usct::ros_interface
