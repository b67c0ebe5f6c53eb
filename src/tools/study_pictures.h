#pragma once

#include <filesystem>
#include <vector>

#include "us_ct_registration/evaluation/study_report.h"

namespace usct::tools {

/// Makes the folder, unless `folder` is empty, before the hours of registrations that the pictures
/// are of. Throws InputError if it cannot be made.
void require_picture_folder(const std::filesystem::path& folder);

/// Draws the worst run of each method and group into `folder/METHOD/worst_GROUP/`, or
/// `folder/worst_GROUP/` if the study has a single method, and tells where. The worst run is the
/// accepted one with the largest error, or one that must have been refused. The folder is made if
/// it is missing.
std::vector<StudyPicture> write_study_pictures(const Study& study, const CaseSource& cases,
                                               const std::vector<StudyRun>& runs,
                                               const std::filesystem::path& folder);

}  // namespace usct::tools
