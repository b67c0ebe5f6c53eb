#pragma once

#include <string>

#include "io/json_members.h"
#include "us_ct_registration/evaluation/study.h"

namespace usct {

/// A run as JSON; docs/studies.md lists the keys. Numbers are read back bit by bit; unknown values
/// are null. The errors of single targets, the covariance and the options are left out.
io::Json run_json(const StudyRun& run);

/// The run of `plan.runs[index]` from its JSON. Trial and names are those of the plan. Throws
/// InputError, naming `source` and the key, for JSON that `run_json` does not make.
StudyRun run_from_json(const io::Json& json, const StudyPlan& plan, std::size_t index,
                       const std::string& source);

}  // namespace usct
