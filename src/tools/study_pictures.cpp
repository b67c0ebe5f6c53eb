#include "study_pictures.h"

#include <algorithm>
#include <map>
#include <optional>

#include "us_ct_registration/error.h"
#include "us_ct_registration/io/ultrasound/ultrasound_source.h"
#include "us_ct_registration/rendering/registration_pictures.h"

namespace usct::tools {
namespace {

constexpr double kPictureSpacingMm = 0.5;

/// Orders runs from harmless to bad: refusals, then accepted runs by their error, then accepted
/// runs that must have been refused, which have no truth.
double badness(const StudyRun& run) {
  if (!run.accepted()) return -1.0;
  return run.after ? run.after->rigid.mean_mm : 1e9;
}

void write_pictures_of(const CaseSource& cases, const StudyRun& run,
                       const std::filesystem::path& folder) {
  const std::shared_ptr<const StudyCase> own = cases(run.trial.us_case);
  const std::shared_ptr<const StudyCase> ct_case = cases(run.trial.ct_case);
  const Ultrasound ultrasound = trial_ultrasound(*own, run.trial);
  RegistrationPictureOptions options;
  options.axes_us = picture_axes(ultrasound);
  options.centre_us_mm = own->centre_us_mm();
  CompoundOptions compounding;
  compounding.hole_fill_radius_mm = 2.0;
  const std::optional<CtVolume> altered = altered_ct(*ct_case, run.trial);
  write_registration_pictures(in_space(ultrasound, kPictureSpacingMm, compounding),
                              altered ? *altered : ct_case->ct, run.trial.T_us_ct_initial,
                              run.result, folder, options);
}

}  // namespace

void require_picture_folder(const std::filesystem::path& folder) {
  if (folder.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!std::filesystem::is_directory(folder))
    throw InputError("--pictures", "'" + folder.string() + "' cannot be made: " + error.message());
}

std::vector<StudyPicture> write_study_pictures(const Study& study, const CaseSource& cases,
                                               const std::vector<StudyRun>& runs,
                                               const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  std::map<std::pair<std::string, std::string>, const StudyRun*> worst;
  for (const StudyRun& run : runs) {
    const StudyRun*& known = worst[{run.method, run.group}];
    if (known == nullptr || badness(run) > badness(*known)) known = &run;
  }
  std::vector<StudyPicture> pictures;
  for (const auto& [name, run] : worst) {
    const std::filesystem::path of_method =
        study.methods.size() > 1 ? folder / run->method : folder;
    std::filesystem::create_directories(of_method);
    pictures.push_back({run->method, run->group, run->case_name, kind_name(run->trial.kind),
                        run->trial.index, of_method / ("worst_" + run->group)});
    write_pictures_of(cases, *run, pictures.back().folder);
  }
  return pictures;
}

}  // namespace usct::tools
