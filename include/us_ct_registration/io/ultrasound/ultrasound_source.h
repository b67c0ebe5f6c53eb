#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "us_ct_registration/ultrasound/ultrasound.h"

/// The function that opens ultrasound of any format, and the options that the formats need beside
/// the file. The table of formats (formats.h) lists the options that each format needs or can use.
namespace usct {

/// A file of ultrasound, with information that its format lacks. An option counts as given if its
/// value differs from the default.
struct UltrasoundSource {
  std::filesystem::path path;

  /// Probe YAML: the geometry that headers of scanners lack.
  std::filesystem::path probe;

  /// Index of the sweep (or volume) in a recording, from 0.
  int sweep = 0;
  /// Number of frames per sweep; 0 if the recording is one sweep.
  int frames_per_sweep = 0;
  /// Whether the first sweep runs against the probe's frame angles; sweeps alternate direction.
  bool first_backward = false;

  /// Plus configuration (XML) with calibrations; none if empty.
  std::filesystem::path calibration;
  /// The pose of each frame follows from a chain of transforms from the coordinate frame `from`, of
  /// the image (or probe), to `to`, which becomes the US frame. An empty `from` means "Image" for
  /// B-mode images and "Probe" for frames before scan conversion.
  std::string from;
  std::string to = "Reference";
  /// Whether frames are left out whose image or pose is not marked valid (the warnings name each).
  /// Otherwise such a frame is an error.
  bool skip_invalid_frames = false;

  /// Placement of the probe in B-mode images (see ImagePlacement), and the number of samples per
  /// line, >= 2. If these and `probe` are given, the images are resampled along the beams.
  std::optional<Eigen::Vector2d> image_origin_px;
  std::optional<Eigen::Vector2d> image_spacing_mm;
  int samples = 0;

  /// Throws InputError if options contradict each other, whatever the format.
  void validate() const;
};

/// One field of UltrasoundSource.
using UltrasoundField =
    std::variant<std::filesystem::path UltrasoundSource::*, std::string UltrasoundSource::*,
                 int UltrasoundSource::*, bool UltrasoundSource::*,
                 std::optional<Eigen::Vector2d> UltrasoundSource::*>;

/// The names by which users give one field of UltrasoundSource.
struct UltrasoundOption {
  UltrasoundField field;
  const char* name;  // of the ROS parameter, and in messages
  const char* flag;  // on the command line
  const char* what;  // with its article: "a probe YAML"
  const char* help;
};

/// All options of UltrasoundSource, for the command line and the ROS parameters.
const std::vector<UltrasoundOption>& ultrasound_options();

struct UltrasoundInput {
  Ultrasound data;
  std::vector<std::string> warnings;
};

/// Reads ultrasound of any format in the table. Throws InputError as the reader of the format does;
/// if the file is not ultrasound; if an option is missing that the format needs; or if one is given
/// that the format cannot use.
UltrasoundInput read_ultrasound(const UltrasoundSource& source);

}  // namespace usct
