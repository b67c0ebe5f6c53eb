#include "ultrasound_options.h"

#include "inputs.h"
#include "us_ct_registration/error.h"

namespace usct::tools {

void UltrasoundOptions::add_to(CLI::App& command) {
  const auto group = [&](const std::string& name) { return command.add_option_group(name); };

  CLI::App* recordings = group("Ultrasonix and Propello recordings, pre-scan sequences");
  recordings->add_option("--probe", source_.probe,
                         "probe YAML: radii (mm), line and motor angles (degrees), sampling");
  recordings->add_option("--sweep", source_.sweep, "which sweep of the recording, from 0")
      ->capture_default_str();
  recordings
      ->add_option("--frames-per-sweep", source_.frames_per_sweep,
                   "Ultrasonix: frames of one sweep; 0 if the recording is one sweep")
      ->capture_default_str();
  recordings->add_flag("--first-backward", source_.first_backward,
                       "sweeps alternate direction; the first one runs backward");

  CLI::App* sequences = group("Tracked sequences (IGSIO)");
  sequences->add_option("--calibration", source_.calibration,
                        "Plus configuration (XML) with calibrations such as ImageToProbe");
  sequences->add_option("--from", source_.from,
                        "coordinate frame of the images in the chain of transforms (Image for "
                        "B-mode, Probe for pre-scan sequences, if not given)");
  sequences->add_option("--to", source_.to, "coordinate frame that becomes the US frame")
      ->capture_default_str();
  sequences->add_flag("--skip-invalid-frames", source_.skip_invalid_frames,
                      "leave out frames whose image or pose is marked invalid, naming each");
  CLI::Option* origin = sequences->add_option(
      "--image-origin", image_origin_px_,
      "column and row of the centre of curvature (of the array, if linear) in a B-mode image; with "
      "--probe, resamples the images along the beams");
  CLI::Option* spacing = sequences->add_option(
      "--image-spacing", image_spacing_mm_,
      "size of a pixel along columns and rows, mm; negative where the image runs the other way");
  CLI::Option* samples = sequences->add_option("--samples", source_.samples,
                                               "samples per line of the resampled beams");
  origin->expected(2)->needs(spacing)->needs(samples);
  spacing->expected(2)->needs(origin);

  CLI::App* tracked = group("Compounding of tracked frames");
  tracked
      ->add_option("--slice-thickness", compounding_.slice_thickness_mm,
                   "a frame fills voxels within half of this from its plane, mm")
      ->capture_default_str();
  tracked
      ->add_option("--hole-fill", compounding_.hole_fill_radius_mm,
                   "bridge gaps between frames up to this distance on either side, mm")
      ->capture_default_str();
  tracked->add_option("--compounding", compounding_.compounding, "where several frames meet")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, Compounding>{{"mean", Compounding::kMean},
                                             {"maximum", Compounding::kMaximum},
                                             {"latest", Compounding::kLatest}}));
}

UltrasoundSource UltrasoundOptions::source(const std::string& path) const {
  UltrasoundSource source = source_;
  source.path = path;
  if (!image_origin_px_.empty()) {
    ImagePlacement placement;
    placement.origin_px = {image_origin_px_[0], image_origin_px_[1]};
    placement.spacing_mm = {image_spacing_mm_[0], image_spacing_mm_[1]};
    source.placement = placement;
  }
  return source;
}

Ultrasound read_ultrasound_with_warnings(const UltrasoundSource& source) {
  UltrasoundInput input = read_ultrasound(source);
  print_warnings(input.warnings);
  return std::move(input.data);
}

}  // namespace usct::tools
