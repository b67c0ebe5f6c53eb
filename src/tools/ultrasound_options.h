#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "us_ct_registration/io/ultrasound/ultrasound_source.h"

namespace usct::tools {

/// Command-line options for ultrasound, the same in every subcommand: those of the table of options
/// (ultrasound_source.h), and how tracked frames are compounded.
class UltrasoundOptions {
 public:
  void add_to(CLI::App& command);

  UltrasoundSource source(const std::string& path) const;
  const CompoundOptions& compounding() const { return compounding_; }

 private:
  UltrasoundSource source_;
  CompoundOptions compounding_;
};

/// Reads the ultrasound; warnings go to standard error.
Ultrasound read_ultrasound_with_warnings(const UltrasoundSource& source);

}  // namespace usct::tools
