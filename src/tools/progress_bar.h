#pragma once

#include <string>

#include "us_ct_registration/progress.h"

namespace usct::tools {

/// A progress bar on standard error, redrawn in place on a terminal. Elsewhere one line per tenth
/// of the work, and none for work that is done within two seconds, so that logs stay short. `quiet`
/// gives an empty Progress.
Progress progress_bar(const std::string& label, bool quiet = false);

}  // namespace usct::tools
