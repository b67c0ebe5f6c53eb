#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "ultrasound_options.h"
#include "us_ct_registration/ultrasound/ultrasound_beams.h"

namespace usct::tools {

/// Command-line options for ultrasound along its beams, the same in every subcommand that uses
/// them.
class BeamCommandOptions {
 public:
  /// Adds these options and those of UltrasoundOptions, with compounding.
  void add_to(CLI::App& command);

  /// Reads the ultrasound; warnings go to standard error.
  Ultrasound read(const std::string& path) const;
  /// The beams of the ultrasound. Throws InputError, naming the option, if an option does not suit
  /// the kind of ultrasound.
  UltrasoundBeams beams(const Ultrasound& ultrasound, bool quiet) const;
  bool are_parallel() const { return parallel_beams_mm_ > 0.0; }
  /// See UltrasoundOptions.
  const CompoundOptions& compounding(const Ultrasound& ultrasound) const {
    return ultrasound_.compounding(ultrasound);
  }
  void require_no_compounding(const std::string& condition) const {
    ultrasound_.require_no_compounding(condition);
  }

 private:
  /// Throws InputError, naming the option, if an option does not suit the kind of ultrasound.
  void check(const Ultrasound& ultrasound) const;

  const CLI::App* command_ = nullptr;
  UltrasoundOptions ultrasound_;
  std::string mask_;
  double parallel_beams_mm_ = 0.0;
  std::string beam_axis_ = "+y";
};

}  // namespace usct::tools
