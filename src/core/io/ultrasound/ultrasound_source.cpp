#include "us_ct_registration/io/ultrasound/ultrasound_source.h"

#include "io/format.h"
#include "io/ultrasound/option_checks.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/formats.h"

namespace usct {
namespace {

using Source = UltrasoundSource;

const UltrasoundOption& option_of(const UltrasoundField& field) {
  for (const UltrasoundOption& option : ultrasound_options())
    if (option.field == field) return option;
  throw std::logic_error("a field of UltrasoundSource is missing from the table of options");
}

std::string text_of(const std::filesystem::path& value) { return value.string(); }
std::string text_of(const std::string& value) { return value; }
std::string text_of(int value) { return std::to_string(value); }
std::string text_of(bool value) { return value ? "true" : "false"; }
std::string text_of(const std::optional<Eigen::Vector2d>& value) {
  return value ? io::format(*value) : "";
}

}  // namespace

const std::vector<UltrasoundOption>& ultrasound_options() {
  static const std::vector<UltrasoundOption> options = {
      {&Source::probe, "probe", "--probe", "a probe YAML",
       "probe YAML: radii (mm), line and motor angles (degrees), sampling"},
      {&Source::sweep, "sweep", "--sweep", "a sweep's number",
       "which sweep of the recording, from 0"},
      {&Source::frames_per_sweep, "frames_per_sweep", "--frames-per-sweep",
       "the number of frames of a sweep", "frames of one sweep; 0 if the recording is one sweep"},
      {&Source::first_backward, "first_backward", "--first-backward", "the first sweep's direction",
       "sweeps alternate direction; the first one runs backward"},
      {&Source::calibration, "calibration", "--calibration", "a Plus configuration",
       "Plus configuration (XML) with calibrations such as ImageToProbe"},
      {&Source::from, "from", "--from", "the images' coordinate frame",
       "coordinate frame of the images in the chain of transforms (Image for B-mode, Probe for "
       "frames before scan conversion, if not given)"},
      {&Source::to, "to", "--to", "the target coordinate frame",
       "coordinate frame that becomes the US frame"},
      {&Source::skip_invalid_frames, "skip_invalid_frames", "--skip-invalid-frames",
       "the treatment of invalid frames",
       "leave out frames whose image or pose is marked invalid, naming each"},
      {&Source::image_origin_px, "image_origin_px", "--image-origin",
       "the place of the probe in the image",
       "column and row of the centre of curvature (of the array, if linear) in a B-mode image; "
       "with "
       "--probe, resamples the images along the beams"},
      {&Source::image_spacing_mm, "image_spacing_mm", "--image-spacing", "the size of a pixel",
       "size of a pixel along columns and rows, mm; negative where the image runs the other way"},
      {&Source::samples, "samples", "--samples", "the number of samples per line",
       "samples per line of the resampled beams"},
  };
  return options;
}

void UltrasoundSource::validate() const {
  if (image_origin_px.has_value() != image_spacing_mm.has_value())
    throw InputError(image_origin_px ? "image_origin_px" : "image_spacing_mm",
                     "is given alone; 'image_origin_px' and 'image_spacing_mm' must be given "
                     "together");
}

void check_ultrasound_options(const UltrasoundSource& source, const FileFormat& format) {
  source.validate();
  const std::string file_of_format = "a file of the format '" + format.name + "'";
  std::vector<UltrasoundField> unusable;
  for (const UltrasoundOption& option : ultrasound_options())
    if (!format.ultrasound || !format.ultrasound->can_use(option.field))
      unusable.push_back(option.field);
  io::refuse_options(source, unusable,
                     file_of_format + " cannot use it: " +
                         (format.ultrasound ? format.ultrasound->refusal : "it is not ultrasound"));
  if (format.ultrasound)
    io::require_options(source, format.ultrasound->needed_options,
                        file_of_format + " does not hold this");
}

UltrasoundInput read_ultrasound(const UltrasoundSource& source) {
  const FileFormat& format = detect_format(source.path);
  if (!format.ultrasound)
    throw InputError(source.path.string(), "is a " + format.name + ", not ultrasound");
  check_ultrasound_options(source, format);
  return format.ultrasound->read(source);
}

}  // namespace usct

namespace usct::io {

bool is_given(const UltrasoundSource& source, const UltrasoundField& option) {
  static const UltrasoundSource defaults;
  return std::visit([&](const auto field) { return source.*field != defaults.*field; }, option);
}

void require_options(const UltrasoundSource& source, const std::vector<UltrasoundField>& options,
                     const std::string& reason) {
  std::string missing;
  for (const UltrasoundField& field : options) {
    if (is_given(source, field)) continue;
    const UltrasoundOption& option = option_of(field);
    missing += missing.empty() ? "" : ", ";
    missing += std::string(option.what) + " is needed ('" + option.name + "')";
  }
  if (!missing.empty()) throw InputError(source.path.string(), missing + "; " + reason);
}

void refuse_options(const UltrasoundSource& source, const std::vector<UltrasoundField>& options,
                    const std::string& reason) {
  for (const UltrasoundField& field : options) {
    if (!is_given(source, field)) continue;
    const std::string value =
        std::visit([&](const auto member) { return text_of(source.*member); }, field);
    throw InputError(source.path.string(), "'" + std::string(option_of(field).name) + "' is '" +
                                               value + "', but " + reason);
  }
}

}  // namespace usct::io
