#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/evaluation/study_run.h"
#include "us_ct_registration/registration/registration_options.h"

/// A study: cases with known truth, each registered by several methods from many starts.
/// study_work.h carries it out; study_statistics.h and study_report.h make tables of its runs.
namespace usct {

/// A way to register.
struct StudyMethod {
  /// Unique in the study; letters, digits, '_', '-', '.', and '+'.
  std::string name;
  RegistrationOptions options;
  /// If set, the scan-converted ultrasound is registered, along parallel beams on a grid of this
  /// spacing (the thesis' variant A).
  std::optional<double> parallel_beams_mm;
};

/// The registration that the method stands for.
Register registers_with(const StudyMethod& method);

struct Study {
  /// Folders as `usct phantom` writes them, and folders of which only the CT is used; see
  /// read_study_case and read_stranger.
  std::vector<std::filesystem::path> cases;
  std::vector<std::filesystem::path> strangers;
  std::vector<StudyMethod> methods;
  StudyOptions starts;
  /// A run has succeeded if it was accepted with a TRE below this, mm; > 0.
  double success_mm = 5.0;
  StudyThreads how = StudyThreads::kOverTrials;

  /// Throws InputError, naming `source`, if an option is invalid, there is no method, or a name is
  /// invalid or not unique.
  void validate(const std::string& source = "study") const;
};

/// One registration of a study.
struct PlannedRun {
  std::size_t method = 0;
  Trial trial;
  /// 16 hexadecimal digits that differ if anything differs that determines the result: the name,
  /// images, truth and targets of the case, the start, the options, or the version of this package;
  /// and StudyThreads, which times depend on.
  std::string fingerprint;
};

/// All registrations of a study, in order: by case, method, kind, seed and number of the start.
struct StudyPlan {
  Study study;
  /// The cases, then the strangers; without voxels.
  std::vector<StudyCase> cases;
  std::vector<PlannedRun> runs;
};

/// Reads every case once, one after the other. Throws InputError if the study is invalid, as
/// `read_study_case`, and as `plan_trials`.
StudyPlan plan_study(const Study& study);

/// Reads cases of the study when they are asked for, and holds those that were asked for last.
CaseSource case_reader(const Study& study);

}  // namespace usct
