#include "convert_ultrasound.h"

#include <cmath>
#include <limits>
#include <map>

#include "inputs.h"
#include "progress_bar.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/io/ultrasound/igsio.h"
#include "us_ct_registration/io/ultrasound/prescan_nrrd.h"
#include "us_ct_registration/io/ultrasound/propello.h"
#include "us_ct_registration/io/ultrasound/ultrasonix.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::tools {
namespace {

constexpr double kMillidegrees = 1000.0 / kDegree;
/// Steps that differ by less than this are one pitch.
constexpr double kEvenMillidegrees = 0.5;
constexpr double kSpeedOfSoundMPerS = 1540.0;

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

void warn_of_lost_geometry(const std::string& output) {
  print_warnings({output +
                  ": the format has no place for radii, depth and angles; keep the probe's "
                  "YAML with it"});
}

UltrasonixSequence as_ultrasonix(const PreScanVolume& volume) {
  UltrasonixSequence sequence;
  UltrasonixHeader& h = sequence.header;
  h.type = kUltrasonixPreScanB;
  h.frames = volume.geometry.frames();
  h.w = volume.geometry.lines();
  h.h = volume.geometry.samples();
  h.ss = 8;
  // Two-way travel: one sample is speed / (2 frequency) deep.
  h.sf = static_cast<std::int32_t>(
      std::lround(kSpeedOfSoundMPerS * 1000.0 / (2.0 * volume.geometry.axial.spacing_mm)));
  sequence.voxels = volume.voxels;
  return sequence;
}

PropelloVolumes as_propello(const PreScanVolume& volume, const std::string& output) {
  const auto* sweep = std::get_if<MotorSweep>(&volume.geometry.motion);
  if (!sweep) throw InputError(output, "a .vol file holds motorised sweeps, not tracked ones");
  const std::vector<double>& angles = sweep->frame_angles_rad;
  const double pitch = (angles.back() - angles.front()) / static_cast<double>(angles.size() - 1);
  for (std::size_t i = 1; i < angles.size(); ++i)
    if (std::abs(angles[i] - angles[i - 1] - pitch) * kMillidegrees > kEvenMillidegrees)
      throw InputError(output, "a .vol file holds one angle between frames, but step " +
                                   std::to_string(i) + " of this sweep differs from the mean");
  PropelloVolumes volumes;
  volumes.header.volumes = 1;
  volumes.header.fpv = volume.geometry.frames();
  volumes.header.w = volume.geometry.lines();
  volumes.header.h = volume.geometry.samples();
  volumes.header.ss = 8;
  volumes.header.degPerFr = static_cast<std::int32_t>(std::abs(pitch) * kMillidegrees);
  volumes.voxels = volume.voxels;
  return volumes;
}

IgsioSequence as_igsio(const PreScanVolume& volume, const std::string& output) {
  const auto* sweep = std::get_if<TrackedSweep>(&volume.geometry.motion);
  if (!sweep) throw InputError(output, "a sequence holds tracked sweeps, not motorised ones");
  IgsioSequence sequence;
  sequence.width = volume.geometry.samples();
  sequence.height = volume.geometry.lines();
  sequence.orientation = "FM";
  sequence.image_type = "BRIGHTNESS";
  sequence.data = volume.voxels;
  for (std::size_t i = 0; i < sweep->T_us_frame.size(); ++i) {
    IgsioFrame frame;
    frame.image_status = "OK";
    if (!sweep->frame_times_s.empty()) frame.timestamp_s = sweep->frame_times_s[i];
    frame.transforms["ProbeToReference"] = {Eigen::Affine3d(sweep->T_us_frame[i].matrix()), "OK"};
    sequence.frames.push_back(frame);
  }
  return sequence;
}

void write_beams(const PreScanVolume& volume, const std::string& output) {
  if (ends_with(output, ".nrrd")) {
    write_prescan_nrrd(volume, output);
  } else if (ends_with(output, ".bpr")) {
    write_ultrasonix(as_ultrasonix(volume), output);
    warn_of_lost_geometry(output);
  } else if (ends_with(output, ".vol")) {
    write_propello(as_propello(volume, output), output);
    warn_of_lost_geometry(output);
  } else if (ends_with(output, ".igs.mha")) {
    write_igsio(as_igsio(volume, output), output, true);
    warn_of_lost_geometry(output);
  } else {
    throw InputError(output,
                     "pre-scan ultrasound is written as .nrrd, .bpr, .vol or .igs.mha; for a "
                     "Cartesian volume give --scan-convert and its spacing");
  }
}

/// All that is known counts: of a Cartesian volume, neither depths nor shadows are told well.
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
  // Along the first index axis the samples have the order of the voxels.
  const BeamUltrasound ultrasound =
      along_beams(converted.volume, converted.mask, BeamAxis{0, true});
  Volume<float> result(converted.volume.grid);
  result.voxels = condition(ultrasound, options, progress_bar("normalisation", quiet)).samples;
  return result;
}

}  // namespace

void UltrasoundConversion::add_to(CLI::App& command) {
  CLI::App* group = command.add_option_group("Scan conversion");
  CLI::Option* spacing =
      group->add_option("--scan-convert", scan_convert_mm,
                        "spacing in mm of a Cartesian volume in the US frame; without it the beams "
                        "are kept");
  spacing->check(CLI::Range(0.05, 20.0));
  group->add_option("--mask", mask, "also write the validity mask (255 inside the scanned region)")
      ->needs(spacing);
  CLI::Option* normalise = group->add_option(
      "--normalise", normalisation,
      "float volume: 'flattened', minus the local mean, in standard deviations of the whole; "
      "'z-score', minus the local mean, over the local standard deviation");
  normalise->needs(spacing)->transform(CLI::CheckedTransformer(std::map<std::string, Normalisation>{
      {"flattened", Normalisation::kFlatten}, {"z-score", Normalisation::kZScore}}));
  group->add_option("--smoothing", smoothing_mm, "Gaussian against speckle, before --normalise, mm")
      ->needs(normalise)
      ->capture_default_str();
  group->add_option("--normalisation-window", window_mm, "Gaussian of the local mean, mm")
      ->needs(normalise)
      ->capture_default_str();
  input.add_to(command);
}

void convert_ultrasound(const std::string& input, const std::string& output,
                        const UltrasoundConversion& conversion, bool quiet) {
  const Ultrasound ultrasound = read_ultrasound_with_warnings(conversion.input.source(input));
  if (conversion.scan_convert_mm > 0.0) {
    const ScanConverted converted =
        in_space(ultrasound, conversion.scan_convert_mm, conversion.input.compounding(),
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
