#include "convert_ultrasound.h"

#include <limits>

#include "commands.h"
#include "inputs.h"
#include "option_checks.h"
#include "progress_bar.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/formats.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::tools {
namespace {

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// Whether the motor swings towards smaller angles, as in every other sweep of a recording.
bool runs_backward(const ScanGeometry& geometry) {
  const auto* sweep = std::get_if<MotorSweep>(&geometry.motion);
  return sweep && sweep->frame_angles_rad.front() > sweep->frame_angles_rad.back();
}

}  // namespace

void write_beams(const PreScanVolume& volume, const std::string& output) {
  std::string endings;
  for (const FileFormat& format : file_formats()) {
    if (!format.ultrasound || format.ultrasound->write == nullptr) continue;
    const UltrasoundFormat& ultrasound = *format.ultrasound;
    endings += (endings.empty() ? "" : ", ") + ultrasound.written_ending;
    if (!ends_with(output, ultrasound.written_ending)) continue;
    ultrasound.write(volume, output);
    if (ultrasound.can_use(&UltrasoundSource::first_backward) && runs_backward(volume.geometry))
      print_warnings({output +
                      ": the sweep runs backward, for which the format has no place; read it with "
                      "--first-backward, or it is mirrored"});
    if (ultrasound.can_use(&UltrasoundSource::probe))
      print_warnings({output +
                      ": the format has no place for radii, depth and angles; keep the probe's "
                      "YAML with it"});
    return;
  }
  throw InputError(output, "pre-scan ultrasound is written as one of " + endings +
                               "; for a Cartesian volume give --scan-convert and its spacing");
}

namespace {

/// The brightness normalised over all voxels inside the mask. Nothing else is excluded: in a
/// Cartesian volume, depths, shadows and lines without contact are not known.
Volume<float> normalised(const ScanConverted& converted, const UltrasoundConversion& conversion,
                         bool quiet) {
  ConditioningOptions options;
  options.normalisation = conversion.normalisation;
  options.smoothing_mm = conversion.smoothing_mm;
  options.window_mm = conversion.window_mm;
  options.depth.automatic = false;
  options.saturated_grey.reset();
  options.no_contact_share = 0.0;
  options.shadow_share = 0.0;
  // With beams along the first index axis, the samples have the order of the voxels.
  const BeamUltrasound ultrasound =
      along_beams(converted.volume, converted.mask, BeamAxis{0, true});
  Volume<float> result(converted.volume.grid);
  result.voxels = condition(ultrasound, options, progress_bar("normalisation", quiet)).samples;
  return result;
}

/// The mask is the second file: without this check, a bad name would leave the first one alone.
void require_mask_place(const std::string& mask) {
  require_place("--mask", mask);
  if (!has_volume_extension(mask) || ends_with(mask, ".nhdr"))
    throw InputError("--mask", "is '" + mask +
                                   "', must end as a volume: .nrrd, .mha, .mhd, .nii "
                                   "or .nii.gz");
}

}  // namespace

void UltrasoundConversion::add_to(CLI::App& command) {
  CLI::App* group = command.add_option_group("Scan conversion");
  CLI::Option* spacing =
      group->add_option("--scan-convert", scan_convert_mm,
                        "spacing in mm of a Cartesian volume in the US frame; without it the beams "
                        "are kept");
  spacing->check(within(0.05, 20.0));
  writes(group->add_option("--mask", mask,
                           "also write the validity mask (255 inside the scanned region)"))
      ->needs(spacing);
  CLI::Option* normalise = group->add_option(
      "--normalise", normalisation,
      "float volume: 'flattened', minus the local mean, in standard deviations of the whole; "
      "'z-score', minus the local mean, over the local standard deviation");
  normalise->needs(spacing)->transform(named<Normalisation>(
      {{"flattened", Normalisation::kFlatten}, {"z-score", Normalisation::kZScore}}));
  group->add_option("--smoothing", smoothing_mm, "Gaussian against speckle, before --normalise, mm")
      ->needs(normalise)
      ->capture_default_str();
  group->add_option("--normalisation-window", window_mm, "Gaussian of the local mean, mm")
      ->needs(normalise)
      ->capture_default_str();
  input.add_to(command);
  input.add_compounding_to(command);
}

void convert_ultrasound(const std::string& input, const std::string& output,
                        const UltrasoundConversion& conversion, bool quiet) {
  if (!conversion.mask.empty()) require_mask_place(conversion.mask);
  const Ultrasound ultrasound = read_ultrasound_with_warnings(conversion.input.source(input));
  if (conversion.scan_convert_mm > 0.0) {
    const ScanConverted converted =
        in_space(ultrasound, conversion.scan_convert_mm, conversion.input.compounding(ultrasound),
                 progress_bar("scan conversion", quiet));
    if (conversion.normalisation == Normalisation::kNone)
      write_volume(converted.volume, output);
    else
      write_volume(normalised(converted, conversion, quiet), output);
    if (!conversion.mask.empty()) write_volume(converted.mask, conversion.mask);
    return;
  }
  const auto* prescan = std::get_if<PreScanVolume>(&ultrasound);
  if (!prescan)
    throw InputError(input,
                     "holds B-mode images; give --scan-convert for a Cartesian volume, or --probe "
                     "and --image-origin to resample them along the beams");
  write_beams(*prescan, output);
}

}  // namespace usct::tools
