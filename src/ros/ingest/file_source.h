#pragma once

#include "ros/ingest/ingest_parameters.h"
#include "ros/ingest/ingest_source.h"

namespace usct::ros_interface {

/// Reads one file and publishes its volume, once.
class FileSource : public IngestSource {
 public:
  /// Throws if the file cannot be read.
  FileSource(const FileOptions& options, const PublishVolume& publish);

  void describe(diagnostic_updater::DiagnosticStatusWrapper&) override {}
};

/// Reads the file `path` and publishes it; `options` apply except for their own path. Throws
/// std::runtime_error with the reason if the file cannot be read. Log and reason call the file
/// `shown_as`, and other files of its folder by number, because names of files may be those of
/// patients.
void publish_file(const std::filesystem::path& path, const std::string& shown_as,
                  const FileOptions& options, const PublishVolume& publish);

}  // namespace usct::ros_interface
