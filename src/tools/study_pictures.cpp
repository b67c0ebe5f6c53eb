#include "study_pictures.h"

#include <algorithm>
#include <map>
#include <optional>

#include "us_ct_registration/io/ultrasound/ultrasound_source.h"
#include "us_ct_registration/rendering/registration_pictures.h"

namespace usct::tools {
namespace {

constexpr double kPictureSpacingMm = 0.5;

using Runs = std::vector<const StudyRun*>;

std::map<std::string, Runs> by_group(const std::vector<StudyRun>& runs) {
  std::map<std::string, Runs> groups;
  for (const StudyRun& run : runs) groups[run.group].push_back(&run);
  return groups;
}

/// Orders runs from harmless to bad: refusals, then accepted runs by their error, then accepted
/// runs that must have been refused, which have no truth.
double badness(const StudyRun& run) {
  if (!run.accepted()) return -1.0;
  return run.after ? run.after->rigid.mean_mm : 1e9;
}

void write_pictures_of(const std::vector<StudyCase>& cases, const StudyRun& run,
                       const std::filesystem::path& folder) {
  const Ultrasound ultrasound = trial_ultrasound(cases, run.trial);
  RegistrationPictureOptions options;
  options.axes_us = picture_axes(ultrasound);
  options.centre_us_mm = cases[run.trial.us_case].centre_us_mm();
  CompoundOptions compounding;
  compounding.hole_fill_radius_mm = 2.0;
  const std::optional<CtVolume> altered = altered_ct(cases, run.trial);
  write_registration_pictures(in_space(ultrasound, kPictureSpacingMm, compounding),
                              altered ? *altered : cases[run.trial.ct_case].ct,
                              run.trial.T_us_ct_initial, run.result, folder, options);
}

}  // namespace

void write_study_pictures(const std::vector<StudyCase>& cases, const std::vector<StudyRun>& runs,
                          const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  const std::map<std::string, Runs> groups = by_group(runs);
  for (const auto& [name, of_group] : groups) {
    const StudyRun* worst = *std::max_element(
        of_group.begin(), of_group.end(),
        [](const StudyRun* a, const StudyRun* b) { return badness(*a) < badness(*b); });
    write_pictures_of(cases, *worst, folder / ("worst_" + name));
  }
}

}  // namespace usct::tools
