#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "commands.h"
#include "convert_ultrasound.h"
#include "exit_status.h"
#include "inputs.h"
#include "option_checks.h"
#include "progress_bar.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/formats.h"
#include "us_ct_registration/io/results/result_io.h"
#include "us_ct_registration/io/results/transform_io.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/volumes/volume_io.h"
#include "us_ct_registration/volume/operations.h"

namespace usct::tools {
namespace {

struct ConvertOptions {
  std::string input;
  std::string output;
  DicomReadOptions dicom;
  bool reorient = false;
  std::string along_beams;
  std::string transform;
  std::vector<double> window_hu;
  UltrasoundConversion ultrasound;
  bool quiet = false;
};

/// Inverse scan conversion: the volume along the beams of an acquisition, in 8 bits.
template <typename T>
PreScanVolume along_beams(const Volume<T>& volume, const ConvertOptions& options) {
  if (options.window_hu.empty())
    throw InputError("--along-beams",
                     "needs --window, the values that become 0 and 255 in the 8-bit result");
  require_rising("--window", options.window_hu);
  const double low = options.window_hu[0];
  const double high = options.window_hu[1];
  PreScanVolume result = read_prescan_nrrd(options.along_beams);
  Eigen::Isometry3d T_volume_us = Eigen::Isometry3d::Identity();
  if (!options.transform.empty()) T_volume_us = read_T_us_ct(options.transform).inverse();
  constexpr float kOutside = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> samples =
      sample_along_beams(volume, beam_grid(result.geometry), T_volume_us, Interpolation::kTrilinear,
                         Outside::constant(kOutside), progress_bar("along beams", options.quiet));
  const auto is_outside = [](float value) { return std::isnan(value); };
  if (std::all_of(samples.begin(), samples.end(), is_outside))
    throw InputError(
        options.input,
        "no beam of '" + options.along_beams + "' meets it " +
            (options.transform.empty() ? "without --transform" : "by '" + options.transform + "'"));
  std::transform(samples.begin(), samples.end(), result.voxels.begin(), [&](float value) {
    if (is_outside(value)) return std::uint8_t{0};
    const double scaled = 255.0 * (value - low) / (high - low);
    return static_cast<std::uint8_t>(std::clamp(std::nearbyint(scaled), 0.0, 255.0));
  });
  return result;
}

template <typename T>
void convert_volume(const Volume<T>& volume, const ConvertOptions& options) {
  if (!options.along_beams.empty())
    write_beams(along_beams(volume, options), options.output);
  else
    write_volume(options.reorient ? reorient_to_axes(volume) : volume, options.output);
}

/// The type of voxel that holds the values of a file which scales what it stores.
std::string type_of_scaled(const Volume<float>& volume) {
  const auto [least, greatest] = std::minmax_element(volume.voxels.begin(), volume.voxels.end());
  const auto all_lie_in = [&, low = *least, high = *greatest](auto type) {
    using Limits = std::numeric_limits<decltype(type)>;
    return low >= static_cast<float>(Limits::min()) && high <= static_cast<float>(Limits::max());
  };
  const bool are_whole = std::all_of(volume.voxels.begin(), volume.voxels.end(),
                                     [](float value) { return value == std::nearbyint(value); });
  if (are_whole && all_lie_in(std::int16_t{})) return "int16";
  if (are_whole && all_lie_in(std::uint16_t{})) return "uint16";
  return "float32";
}

/// Converts in the type of voxel that the file stores, or the closest one that can be written.
void convert_volume_file(const ConvertOptions& options) {
  const VolumeInfo info = read_volume_info(options.input);
  print_warnings(info.warnings);
  const bool is_scaled = info.scale != 1.0 || info.offset != 0.0;
  const std::string component =
      is_scaled ? type_of_scaled(read_volume<float>(options.input)) : info.component;
  if (component == "uint8")
    convert_volume(read_volume<std::uint8_t>(options.input), options);
  else if (component == "uint16")
    convert_volume(read_volume<std::uint16_t>(options.input), options);
  else if (component.rfind("float", 0) == 0)
    convert_volume(read_volume<float>(options.input), options);
  else
    convert_volume(read_volume<std::int16_t>(options.input), options);
}

/// Throws InputError if one of the options that are given is for another content.
void check_options(const ConvertOptions& options, const FileFormat& format) {
  const auto refuse_if = [&](bool is_given, const char* option, const char* content) {
    if (is_given)
      throw InputError(options.input, "'" + std::string(option) + "' is for " + content +
                                          ", but this is a " + format.name);
  };
  if (format.content != FileContent::kCtSeries) require_no_choice(options.dicom, options.input);
  if (format.content != FileContent::kCtSeries && format.content != FileContent::kVolume) {
    refuse_if(options.reorient, "--reorient", "volumes");
    refuse_if(!options.along_beams.empty(), "--along-beams", "volumes");
  }
  if (format.content != FileContent::kUltrasound)
    refuse_if(options.ultrasound.scan_convert_mm > 0.0, "--scan-convert", "ultrasound");
  if (options.ultrasound.scan_convert_mm == 0.0)
    options.ultrasound.input.require_no_compounding("--scan-convert is given");
  check_ultrasound_options(options.ultrasound.input.source(options.input), format);
}

/// The transform of a registered result. Throws InputError for any other result.
Eigen::Isometry3d transform_of_result(const std::string& path) {
  const RegistrationResult result = read_result(path);
  if (!result.T_us_ct)
    throw InputError(path, std::string("holds no transform: its status is '") +
                               status_name(result.status) + "' (" + result.message + ")");
  return *result.T_us_ct;
}

int run_convert(const ConvertOptions& options) {
  const FileFormat& format = detect_format(options.input);
  check_options(options, format);
  switch (format.content) {
    case FileContent::kCtSeries:
      convert_volume(read_ct_with_warnings(options.input, options.dicom,
                                           progress_bar("reading", options.quiet)),
                     options);
      break;
    case FileContent::kVolume:
      convert_volume_file(options);
      break;
    case FileContent::kUltrasound:
      convert_ultrasound(options.input, options.output, options.ultrasound, options.quiet);
      break;
    case FileContent::kTransform:
      write_T_us_ct(read_T_us_ct(options.input), options.output);
      break;
    case FileContent::kResult:
      write_T_us_ct(transform_of_result(options.input), options.output);
      break;
    case FileContent::kPoints:
    case FileContent::kProbe:
      throw InputError(options.input,
                       "is a " + format.name + ", which has one format only: nothing to convert");
  }
  std::printf("%s\n", options.output.c_str());
  return kDone;
}

}  // namespace

void add_convert_command(CLI::App& app, Run& run) {
  CLI::App* command = app.add_subcommand(
      "convert",
      "Converts between the files that 'usct info' knows; the output's extension says the format.\n"
      "  CT or volume      -> .nrrd .mha .mhd .nii .nii.gz\n"
      "  ultrasound        -> .nrrd (pre-scan), .bpr, .vol, .igs.mha; with --scan-convert a "
      "volume\n"
      "  CT or volume      -> .nrrd (pre-scan) with --along-beams: inverse scan conversion\n"
      "  transform, result -> .tfm .txt .h5\n"
      "Millimetres and degrees; CT in LPS, ultrasound in the US frame (x lateral, y axial, z "
      "elevation).");
  auto options = std::make_shared<ConvertOptions>();
  command->add_option("input", options->input, "file or DICOM folder")->required();
  command->add_option("output", options->output, "file to write")->required();

  add_dicom_options(*command, options->dicom);

  CLI::App* volume = command->add_option_group("Volumes");
  CLI::Option* along_beams =
      volume->add_option("--along-beams", options->along_beams,
                         "pre-scan file whose beams the volume is sampled along");
  volume
      ->add_flag("--reorient", options->reorient,
                 "permute and flip the axes to be as close to x, y, z as they can")
      ->excludes(along_beams);
  volume
      ->add_option("--transform", options->transform,
                   "ITK transform from US to volume points, for --along-beams (identity if not "
                   "given)")
      ->needs(along_beams);
  volume->add_option("--window", options->window_hu, "values that become 0 and 255")
      ->expected(2)
      ->needs(along_beams);

  options->ultrasound.add_to(*command);
  command->add_flag("--quiet", options->quiet, "no progress bar");
  command->callback([options, &run] { run = [options] { return run_convert(*options); }; });
}

}  // namespace usct::tools
