#include "us_ct_registration/io/formats.h"

#include <algorithm>
#include <cctype>

#include "io/bytes.h"
#include "io/ultrasound/igsio_ultrasound.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/io/results/points_io.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/igsio.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/ultrasound/probe_config.h"
#include "us_ct_registration/io/ultrasound/propello.h"
#include "us_ct_registration/io/ultrasound/ultrasonix.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct {
namespace {

using Source = UltrasoundSource;

constexpr const char* kOwnGeometry = "it holds its own geometry";

UltrasoundInput read_cartesian(const Source& source) {
  return {read_volume<std::uint8_t>(source.path), {}};
}

UltrasoundInput read_prescan(const Source& source) { return {read_prescan_nrrd(source.path), {}}; }

UltrasoundFormat igsio_sequence() {
  return {read_igsio_ultrasound,
          {},
          {&Source::probe, &Source::calibration, &Source::from, &Source::to,
           &Source::skip_invalid_frames, &Source::image_origin_px, &Source::image_spacing_mm,
           &Source::samples},
          "it holds one sweep, with a pose for each frame",
          ".igs.mha",
          write_igsio_beams};
}

/// A recording of a scanner whose header lacks the geometry of the probe.
UltrasoundFormat motorised_recording(
    UltrasoundInput (*read)(const Source&), std::vector<UltrasoundField> usable_options,
    const char* ending, void (*write)(const PreScanVolume&, const std::filesystem::path&)) {
  return {read,
          {&Source::probe},
          std::move(usable_options),
          "it holds sweeps of a motorised probe, without poses",
          ending,
          write};
}

/// The rows are in order of precedence. The content of a file counts before its name where
/// possible: a pre-scan NRRD and an IGSIO sequence have the endings of volumes.
std::vector<FileFormat> make_table() {
  return {
      {"DICOM series", FileContent::kCtSeries, {}, is_dicom, describe_dicom, {}},
      {"pre-scan ultrasound (NRRD)",
       FileContent::kUltrasound,
       {},
       is_prescan_nrrd,
       describe_prescan_nrrd,
       UltrasoundFormat{read_prescan, {}, {}, kOwnGeometry, ".nrrd", write_prescan_nrrd}},
      {"tracked ultrasound sequence (IGSIO)",
       FileContent::kUltrasound,
       {},
       is_igsio,
       describe_igsio,
       igsio_sequence()},
      {"volume",
       FileContent::kVolume,
       {},
       has_volume_extension,
       describe_volume,
       UltrasoundFormat{read_cartesian, {}, {}, kOwnGeometry, "", nullptr}},
      {"ITK transform",
       FileContent::kTransform,
       {".tfm", ".txt", ".h5", ".hdf5", ".mat"},
       nullptr,
       describe_transform,
       {}},
      {"registration result", FileContent::kResult, {".json"}, nullptr, describe_result, {}},
      {"points (CSV)", FileContent::kPoints, {".csv"}, nullptr, describe_points, {}},
      {"probe configuration",
       FileContent::kProbe,
       {".yaml", ".yml"},
       nullptr,
       describe_probe_config,
       {}},
      {"Propello volumes",
       FileContent::kUltrasound,
       {".vol"},
       is_propello,
       describe_propello,
       motorised_recording(read_propello_ultrasound, {&Source::sweep, &Source::first_backward},
                           ".vol", write_propello_beams)},
      {"Ultrasonix recording",
       FileContent::kUltrasound,
       {".bpr", ".b8", ".b32", ".rf", ".mpr", ".m"},
       is_ultrasonix,
       describe_ultrasonix,
       motorised_recording(read_ultrasonix_ultrasound,
                           {&Source::sweep, &Source::frames_per_sweep, &Source::first_backward},
                           ".bpr", write_ultrasonix_beams)},
  };
}

bool has_ending(const std::filesystem::path& path, const std::string& ending) {
  const std::string name = path.filename().string();
  return name.size() > ending.size() &&
         std::equal(ending.rbegin(), ending.rend(), name.rbegin(),
                    [](char a, unsigned char b) { return a == std::tolower(b); });
}

bool matches(const FileFormat& format, const std::filesystem::path& path) {
  return std::any_of(format.endings.begin(), format.endings.end(),
                     [&](const std::string& ending) { return has_ending(path, ending); }) ||
         (format.recognises != nullptr && format.recognises(path));
}

}  // namespace

bool UltrasoundFormat::needs(const UltrasoundField& option) const {
  return std::find(needed_options.begin(), needed_options.end(), option) != needed_options.end();
}

bool UltrasoundFormat::can_use(const UltrasoundField& option) const {
  return needs(option) ||
         std::find(usable_options.begin(), usable_options.end(), option) != usable_options.end();
}

const std::vector<FileFormat>& file_formats() {
  static const std::vector<FileFormat> table = make_table();
  return table;
}

const FileFormat& detect_format(const std::filesystem::path& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (status.type() == std::filesystem::file_type::not_found)
    throw InputError(path.string(), "does not exist");
  if (error) throw InputError(path.string(), "cannot be opened: " + error.message());
  // The readers refuse an empty or unreadable file as well, but not every row reads the file.
  if (!std::filesystem::is_directory(status)) io::read_prefix(path, 1);
  std::string names;
  for (const FileFormat& format : file_formats()) {
    if (matches(format, path)) return format;
    names += (names.empty() ? "" : ", ") + format.name;
  }
  throw InputError(path.string(), "is none of the files that are read: " + names);
}

}  // namespace usct
