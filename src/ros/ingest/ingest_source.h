#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <us_ct_registration/PreScanVolume.h>

#include <functional>

namespace usct::ros_interface {

/// Publishes a volume. May be called from any thread.
using PublishVolume = std::function<void(const us_ct_registration::PreScanVolumeConstPtr&)>;

/// Period at which a source checks whether frames have paused, s.
constexpr double kPauseCheckPeriod_s = 0.05;

/// A source of ultrasound. It works from its construction on, and passes each volume to its
/// PublishVolume.
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
