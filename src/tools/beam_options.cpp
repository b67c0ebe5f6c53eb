#include "beam_options.h"

#include "option_checks.h"
#include "progress_bar.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/volumes/volume_io.h"

namespace usct::tools {

void BeamCommandOptions::add_to(CLI::App& command) {
  command_ = &command;
  CLI::App* group = command.add_option_group("Beams of the ultrasound");
  group
      ->add_option("--parallel-beams", parallel_beams_mm_,
                   "scan-convert to this spacing, mm, and let the beams run along an axis of that "
                   "(variant A of the thesis); needed by images whose beams are not known")
      ->check(within(0.05, 10.0));
  group
      ->add_option("--beam-axis", beam_axis_,
                   "of a Cartesian volume, or of --parallel-beams: +x, -x, +y, ...")
      ->capture_default_str();
  group->add_option("--us-mask", mask_, "where a Cartesian volume is known (not 0)");
  ultrasound_.add_to(command);
  ultrasound_.add_compounding_to(command);
}

Ultrasound BeamCommandOptions::read(const std::string& path) const {
  return read_ultrasound_with_warnings(ultrasound_.source(path));
}

void BeamCommandOptions::check(const Ultrasound& ultrasound) const {
  const bool is_volume = std::holds_alternative<UsVolume>(ultrasound);
  if (std::holds_alternative<TrackedImages>(ultrasound) && !are_parallel())
    throw InputError("--parallel-beams", "is missing, must be given for images without beams");
  if (is_volume) require_left_out(*command_, {"--parallel-beams"}, "the ultrasound has frames");
  if (!is_volume)
    require_left_out(*command_, {"--us-mask"}, "the ultrasound is a Cartesian volume");
  if (!is_volume && !are_parallel())
    require_left_out(*command_, {"--beam-axis"},
                     "the ultrasound is a Cartesian volume or --parallel-beams is given");
}

UltrasoundBeams BeamCommandOptions::beams(const Ultrasound& ultrasound, bool quiet) const {
  check(ultrasound);
  BeamOptions options;
  options.axis = parse_beam_axis(beam_axis_, "--beam-axis");
  options.compounding = compounding(ultrasound);
  if (are_parallel()) options.parallel_beams_mm = parallel_beams_mm_;
  if (!mask_.empty()) options.mask = read_volume<std::uint8_t>(mask_);
  return beams_of(ultrasound, options, progress_bar("scan conversion", quiet));
}

}  // namespace usct::tools
