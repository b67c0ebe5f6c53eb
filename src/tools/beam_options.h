#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "ultrasound_options.h"
#include "us_ct_registration/ultrasound/ultrasound_beams.h"

namespace usct::tools {

/// Options for ultrasound that is needed along its beams; the same in every subcommand.
class BeamCommandOptions {
 public:
  /// With those of UltrasoundOptions.
  void add_to(CLI::App& command);

  /// Reads it; warnings go to standard error.
  Ultrasound read(const std::string& path) const;
  /// Throws InputError, naming the option, for one that does not suit the ultrasound.
  UltrasoundBeams beams(const Ultrasound& ultrasound, bool quiet) const;
  const CompoundOptions& compounding() const { return ultrasound_.compounding(); }

 private:
  UltrasoundOptions ultrasound_;
  std::string mask_;
  double parallel_beams_mm_ = 0.0;
  std::string beam_axis_ = "+y";
};

}  // namespace usct::tools
