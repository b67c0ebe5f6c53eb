#pragma once

#include <functional>

#include "us_ct_registration/evaluation/study_work.h"

namespace usct::tools {

/// Reports the runs that are done and the time that is left on standard error: on a terminal on one
/// line, else as a line at most every half minute. Empty if `quiet`.
std::function<void(const StudyProgress&)> study_progress(bool quiet);

}  // namespace usct::tools
