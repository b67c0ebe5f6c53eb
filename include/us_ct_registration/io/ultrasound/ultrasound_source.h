#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/ultrasound/ultrasound.h"

/// The one place that opens ultrasound, whatever the format.
namespace usct {

/// A file of ultrasound and what its format leaves open.
struct UltrasoundSource {
  std::filesystem::path path;

  /// Probe YAML. Needed by Ultrasonix and Propello files and by pre-scan IGSIO sequences; turns
  /// B-mode IGSIO sequences into beams (with `placement`).
  std::filesystem::path probe;

  /// Ultrasonix and Propello: which sweep (volume) of the recording.
  int sweep = 0;
  /// Ultrasonix: 0 if the recording is one sweep. Propello files say it themselves.
  int frames_per_sweep = 0;
  /// Sweeps alternate direction: whether the first one runs against the probe's frame angles.
  bool first_backward = false;

  /// IGSIO: Plus configuration (XML) with calibrations; none if empty.
  std::filesystem::path calibration;
  /// IGSIO: the chain of transforms that gives each frame its pose, from the image (or probe) to
  /// the US frame. An empty `from` means "Image" for B-mode and "Probe" for pre-scan sequences.
  std::string from;
  std::string to = "Reference";
  /// IGSIO: leave frames out whose image or pose is not marked valid (each is named in the
  /// warnings). Otherwise such a frame is an error.
  bool skip_invalid_frames = false;
  /// B-mode IGSIO with a probe: where the probe appears in the image, and how many samples each
  /// line is to have.
  std::optional<ImagePlacement> placement;
  int samples = 0;
};

struct UltrasoundInput {
  Ultrasound data;
  std::vector<std::string> warnings;
};

/// Throws InputError as the readers of each format do, and if an option is missing that the format
/// needs, or given that it cannot use.
UltrasoundInput read_ultrasound(const UltrasoundSource& source);

}  // namespace usct
