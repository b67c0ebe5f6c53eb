#pragma once

#include <string>

#include "ultrasound_options.h"
#include "us_ct_registration/ultrasound/conditioning.h"

namespace usct::tools {

/// Options of `usct convert` for ultrasound: how to read it, and what to make of it.
struct UltrasoundConversion {
  UltrasoundOptions input;
  /// Isotropic spacing of a Cartesian result; 0 keeps the beams.
  double scan_convert_mm = 0.0;
  /// Where to write the validity mask of a Cartesian result; empty for nowhere.
  std::string mask;
  /// Unless kNone, a Cartesian result is written as float, normalised over the scanned region.
  Normalisation normalisation = Normalisation::kNone;
  double smoothing_mm = ConditioningOptions{}.smoothing_mm;
  double window_mm = ConditioningOptions{}.window_mm;

  void add_to(CLI::App& command);
};

/// Writes pre-scan ultrasound in the first format of the table whose files have the ending of
/// `output`. Throws InputError if none has.
void write_beams(const PreScanVolume& volume, const std::string& output);

/// Writes `output` in the format of its extension. Throws InputError if that format cannot hold the
/// ultrasound.
void convert_ultrasound(const std::string& input, const std::string& output,
                        const UltrasoundConversion& conversion, bool quiet);

}  // namespace usct::tools
