#pragma once

#include <string>

#include "us_ct_registration/progress.h"

namespace usct::tools {

/// A progress bar on standard error, redrawn in place on a terminal. In a log file it prints one
/// line per tenth of the work, and nothing for work that takes less than two seconds. `quiet`
/// returns an empty Progress.
Progress progress_bar(const std::string& label, bool quiet = false);

}  // namespace usct::tools
