#pragma once

#include <filesystem>
#include <vector>

#include "us_ct_registration/evaluation/study.h"

namespace usct::tools {

/// In `folder`, which is created: `tre_cdf.png`, the share of runs with an error up to x, by group;
/// `calibration.png`, expected against true errors, if runs tell them; and for the worst run of
/// each group the pictures of the registration, in a folder named after the group.
void write_study_pictures(const std::vector<StudyCase>& cases, const std::vector<StudyRun>& runs,
                          const std::filesystem::path& folder);

}  // namespace usct::tools
