#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <vector>

#include "us_ct_registration/io/ultrasound/ultrasound_source.h"

namespace usct::tools {

/// Options for what a format of ultrasound leaves open; the same in every subcommand.
class UltrasoundOptions {
 public:
  void add_to(CLI::App& command);

  /// The source for `path`. Throws InputError if options contradict each other.
  UltrasoundSource source(const std::string& path) const;
  const CompoundOptions& compounding() const { return compounding_; }

 private:
  UltrasoundSource source_;
  CompoundOptions compounding_;
  std::vector<double> image_origin_px_;
  std::vector<double> image_spacing_mm_;
};

/// Reads it; warnings go to standard error.
Ultrasound read_ultrasound_with_warnings(const UltrasoundSource& source);

}  // namespace usct::tools
