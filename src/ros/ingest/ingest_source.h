#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>

namespace usct::ros_interface {

/// Period at which a source checks whether frames have paused, s.
constexpr double kPauseCheckPeriod_s = 0.05;

/// A source of ultrasound. It works from its construction on, and tells a VolumePublisher of each
/// sweep.
class IngestSource {
 public:
  IngestSource() = default;
  virtual ~IngestSource() = default;
  IngestSource(const IngestSource&) = delete;
  IngestSource& operator=(const IngestSource&) = delete;

  /// Adds the source's problems to the summary, and its numbers to the values.
  virtual void describe(diagnostic_updater::DiagnosticStatusWrapper& status) = 0;
};

}  // namespace usct::ros_interface
