#pragma once

#include <ros/node_handle.h>

#include <filesystem>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>

#include "ros/ingest/ingest_parameters.h"
#include "ros/ingest/ingest_source.h"
#include "ros/ingest/volume_publisher.h"

namespace usct::ros_interface {

/// The volume of a file, to be stamped. Log and errors call the file `shown_as`, and other files of
/// its folder by number, because names of files may be those of patients.
class FileVolume {
 public:
  /// Reads the file `path`; `options` apply except for their own path. Throws std::runtime_error
  /// with the reason if the file cannot be read.
  FileVolume(std::filesystem::path path, std::string shown_as, const FileOptions& options);

  /// Names what the volume waits for before it can be stamped; empty if it can be stamped `now`.
  std::string awaited(const ::ros::Time& now) const;
  /// Throws std::runtime_error with the reason if the volume cannot be stamped at `now`.
  us_ct_registration::PreScanVolumePtr stamped(const ::ros::Time& now) const;

 private:
  template <typename Step>
  auto retelling(const Step& step) const;

  const std::filesystem::path path_;
  const std::string shown_as_;
  const FileOptions options_;
  const PreScanVolume volume_;
};

/// Reads one file and publishes its volume, once.
class FileSource : public IngestSource {
 public:
  /// Throws if the file cannot be read or stamped. A volume that has to wait for its stamp is
  /// published later.
  FileSource(::ros::NodeHandle node, const FileOptions& options, VolumePublisher& volumes);

  void describe(diagnostic_updater::DiagnosticStatusWrapper& status) override;

 private:
  void publish_once_stamped();

  VolumePublisher& volumes_;
  std::mutex mutex_;                  // guards volume_
  std::optional<FileVolume> volume_;  // empty once it is published
  ::ros::WallTimer timer_;            // last: its callback uses all of the above
};

}  // namespace usct::ros_interface
