#pragma once

#include <string>

#include "ultrasound_options.h"
#include "us_ct_registration/ultrasound/conditioning.h"

namespace usct::tools {

/// What `usct convert` can make of ultrasound, beyond how to read it.
struct UltrasoundConversion {
  UltrasoundOptions input;
  /// Isotropic spacing of a Cartesian result; 0 keeps the beams.
  double scan_convert_mm = 0.0;
  /// Where to write the validity mask of a Cartesian result; empty for nowhere.
  std::string mask;
  /// Cartesian result as float, normalised over all that was scanned; kNone keeps brightness.
  Normalisation normalisation = Normalisation::kNone;
  double smoothing_mm = ConditioningOptions{}.smoothing_mm;
  double window_mm = ConditioningOptions{}.window_mm;

  void add_to(CLI::App& command);
};

/// Writes `output` in the format of its extension. Throws InputError where that format cannot hold
/// what the input is.
void convert_ultrasound(const std::string& input, const std::string& output,
                        const UltrasoundConversion& conversion, bool quiet);

}  // namespace usct::tools
