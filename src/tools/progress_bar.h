#pragma once

#include <string>

#include "us_ct_registration/progress.h"

namespace usct::tools {

/// A progress bar on standard error, redrawn in place on a terminal; elsewhere one line per tenth
/// of the work, so that logs stay short. `quiet` gives an empty Progress.
Progress progress_bar(const std::string& label, bool quiet = false);

}  // namespace usct::tools
