#pragma once

#include <filesystem>
#include <vector>

#include "us_ct_registration/evaluation/study.h"

namespace usct::tools {

/// For the worst run of each group, writes the pictures of the registration into a folder below
/// `folder` that is named after the group, `worst_GROUP`. Creates the folders.
void write_study_pictures(const std::vector<StudyCase>& cases, const std::vector<StudyRun>& runs,
                          const std::filesystem::path& folder);

}  // namespace usct::tools
