#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/evaluation/study.h"

/// Results of runs as lines of text: JSON objects, one a line, with the fingerprint of the run and
/// a checksum of the line. Processes on several machines can add to one file.
namespace usct {

/// Adds the run as a line at the end of the file, which is made if it is not there. The line is on
/// the disk on return. What an earlier process left of a line at the end is not continued. Throws
/// InputError, naming the file, if it cannot be written to.
void append_result(const std::filesystem::path& file, const StudyRun& run,
                   const std::string& fingerprint);

/// The runs of the plan that the files NAME.jsonl of a folder hold, by index; the first whole line
/// counts if there are several of one run. `warn` is told of each line that is corrupt, and of the
/// lines of each file that belong to no run of the plan. A folder that does not exist holds none.
std::vector<std::optional<StudyRun>> read_results(
    const std::filesystem::path& folder, const StudyPlan& plan,
    const std::function<void(const std::string&)>& warn);

}  // namespace usct
