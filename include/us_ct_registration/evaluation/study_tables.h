#pragma once

#include <string>
#include <vector>

#include "us_ct_registration/evaluation/study.h"
#include "us_ct_registration/ultrasound/ultrasound_beams.h"

/// Tables of a study, as texts.
namespace usct {

struct Table {
  std::string title;
  std::vector<std::string> header;
  /// As many cells in each row as in the header.
  std::vector<std::vector<std::string>> rows;
  /// Sentences below the table; may be empty.
  std::string note;
};

/// The table without its title, then its note; empty if there is neither.
std::string markdown(const Table& table);

/// The runs of one method from starts near the truth, by group: errors, rates, time, and success by
/// displacement of the start. Success is an error below kSuccessMm.
Table accuracy_table(const std::vector<StudyRun>& runs, const std::vector<double>& bin_edges_mm);

/// A row per case, as tables 5.1 and 5.2 of the thesis: mean and deviation of the error of the runs
/// that converged, size and spacing of the ultrasound as it was registered (along `beams`), time
/// per run; and, as in the text of the thesis, the number of runs and the share that converged.
Table thesis_table(const StudyPlan& plan, const CaseSource& cases,
                   const std::vector<StudyRun>& runs, const BeamOptions& beams = {});

/// Negative trials of one method, by kind; no row if there is none.
Table negatives_table(const std::vector<StudyRun>& runs);

/// Expected against physical errors; no row if no run has both.
Table calibration_table(const std::vector<StudyRun>& runs);

/// Methods by rows, from starts near the truth: rates and errors with intervals over subjects, of
/// all runs, by bins of displacement, by group, and by case.
Table methods_table(const Study& study, const std::vector<StudyRun>& runs);
Table bins_table(const Study& study, const std::vector<StudyRun>& runs);
Table groups_table(const Study& study, const std::vector<StudyRun>& runs);
Table cases_table(const Study& study, const std::vector<StudyRun>& runs);

/// Pairs of methods, compared subject by subject.
Table comparisons_table(const Study& study, const std::vector<StudyRun>& runs);

/// Seconds, evaluations and memory of each method.
Table costs_table(const Study& study, const std::vector<StudyRun>& runs);

/// Edges of the bins of displacement, mm. They span the distances over which starts are spread or,
/// for starts from a box, all distances that occur in `runs`.
std::vector<double> bin_edges_mm(const StudyOptions& starts, const std::vector<StudyRun>& runs);

/// The tables of a study that its runs determine, without times and memory.
std::vector<Table> result_tables(const Study& study, const std::vector<StudyRun>& runs);

}  // namespace usct
