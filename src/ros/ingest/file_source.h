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

/// Reads the file `path` with the options of any other file and publishes it. Throws InputError or
/// whatever else kept it from being read (memory, disk), naming the file.
void publish_file(const std::filesystem::path& path, const FileOptions& options,
                  const PublishVolume& publish);

}  // namespace usct::ros_interface
