#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "us_ct_registration/io/ultrasound/ultrasound_source.h"

namespace usct::tools {

/// Command-line options for ultrasound, the same in every subcommand: those of the table of options
/// (ultrasound_source.h), and how tracked frames are compounded, where a subcommand does that.
class UltrasoundOptions {
 public:
  /// Adds the options of the table. Returns their group.
  CLI::App* add_to(CLI::App& command);
  void add_compounding_to(CLI::App& command);

  UltrasoundSource source(const std::string& path) const;
  /// Throws InputError if one of these options is given, but the ultrasound has no tracked frames.
  const CompoundOptions& compounding(const Ultrasound& ultrasound) const;
  /// Throws InputError if one of the options of compounding is given; `condition` says when it may.
  void require_no_compounding(const std::string& condition) const;

 private:
  UltrasoundSource source_;
  CompoundOptions compounding_;
  const CLI::App* compounding_command_ = nullptr;
};

/// Reads the ultrasound; warnings go to standard error.
Ultrasound read_ultrasound_with_warnings(const UltrasoundSource& source);

}  // namespace usct::tools
