#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "us_ct_registration/evaluation/study_profiles.h"
#include "us_ct_registration/evaluation/study_tables.h"

/// Files of a study: Markdown for people, JSON for programs.
namespace usct {

/// A picture of a run, in a folder as `usct study --pictures` writes it.
struct StudyPicture {
  std::string method;
  std::string group;
  std::string case_name;
  std::string kind;
  int start = 0;
  std::filesystem::path folder;
};

/// Pictures and profiles that were made of a study, beside its runs.
struct StudyExtras {
  std::vector<StudyPicture> pictures;
  std::vector<StudyProfile> profiles;
};

/// Markdown of the tables, each below its title.
std::string tables_markdown(const std::vector<Table>& tables);

/// `{"version", "study", "cases", "tables", "pictures", "profiles", "runs"}`: of the study `cases`,
/// `strangers`, `methods` (with every option as text), `starts`, `success_mm` and `one_at_a_time`;
/// the cases that are no strangers with `name`, `T_us_ct_true`, `centre_us_mm` (of the targets),
/// `us_samples` and `ct_voxels`; the tables with `title`, `header`, `rows` and `note`; the pictures
/// with their folders, as seen from the file; the profiles with `method`, `case`, and `axes`, each
/// with `offsets` (mm, then rad) and `values`; the runs in the order of the plan. docs/studies.md
/// lists the keys of a run. Unknown values are null. Writes atomically; throws InputError if the
/// folder cannot be written to.
void write_study_json(const StudyPlan& plan, const std::vector<StudyRun>& runs,
                      const StudyExtras& extras, const std::filesystem::path& path);

/// Writes `tables.md`, which the runs determine, `costs.md`, the times and memory of them, and
/// `study.json` into the folder, each atomically. Throws as above.
void write_study_report(const StudyPlan& plan, const std::vector<StudyRun>& runs,
                        const StudyExtras& extras, const std::filesystem::path& folder);

}  // namespace usct
