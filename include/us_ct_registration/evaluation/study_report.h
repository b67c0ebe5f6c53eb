#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "us_ct_registration/evaluation/study.h"
#include "us_ct_registration/ultrasound/ultrasound_beams.h"

/// Reports of a study: Markdown for people, JSON for programs.
namespace usct {

/// Markdown tables of the runs from starts near the truth, by group: errors, rates, time, and
/// success by displacement of the start.
std::string accuracy_markdown(const std::vector<StudyRun>& runs,
                              const std::vector<double>& bin_edges_mm);

/// Table per case, as tables 5.1 and 5.2 of the thesis: mean and deviation of the error of the runs
/// that converged, size and spacing of the ultrasound as it was registered (along `beams`), time
/// per run; and, as in the text of the thesis, the number of runs and the share that converged.
std::string thesis_markdown(const std::vector<StudyCase>& cases, const std::vector<StudyRun>& runs,
                            const BeamOptions& beams = {});

/// Table of negative trials, by kind; empty if there is none.
std::string negatives_markdown(const std::vector<StudyRun>& runs);

/// Table of expected against physical errors; one line if no run has both.
std::string calibration_markdown(const std::vector<StudyRun>& runs);

/// `{"version", "study": {...}, "runs": [...]}`, `study` as given; each run with `case`, `group`,
/// `ct_case`, `kind`, `start` (its number), `displacement_mm`, `T_us_ct_initial` (16 numbers, row
/// by row), `before_tre_mm` and `tre_mm` (against the rigid truth; objects with `mean`, `rms`,
/// `median`, `max`), `before_physical_mm` and `physical_mm` (the same of the physical errors),
/// `expected_tre_mm` (`rms`, `max`), `candidates` (`similarity`, `overlap`, `tre_mm`,
/// `physical_mm`), and of its result `status`, `message`, `T_us_ct`, `similarity`, `overlap`,
/// `evaluations`, `measures`, `seconds` by stage, `options`.
/// Unknown values are null. Writes atomically; throws InputError if the folder cannot be written
/// to.
void write_study_json(const std::vector<StudyRun>& runs,
                      const std::map<std::string, std::string>& study,
                      const std::filesystem::path& path);

}  // namespace usct
