#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/evaluation/study.h"

/// Carries out a study, in parts and again and again if need be.
namespace usct {

/// Part `number` of `count` parts of a study, counted from 1: every run whose index in the plan is
/// `number - 1` modulo `count`. The parts can be carried out at the same time, on machines that
/// share a folder.
struct StudyShard {
  int number = 1;
  int count = 1;

  /// Throws InputError, naming `source`, unless 1 <= number <= count.
  void validate(const std::string& source) const;
};

/// "2/8". Throws InputError, naming `source`, for any other text.
StudyShard parse_shard(const std::string& text, const std::string& source);

struct StudyProgress {
  std::size_t done = 0;
  std::size_t all = 0;
  /// Estimated from the mean time of each method's runs so far; NaN before the first one.
  double seconds_left = 0.0;
};

struct StudyWork {
  /// Folder of the results; the runs are only in memory if it is empty. Results are kept below it
  /// in `runs/`, a file of lines for each shard, to which each run is added as soon as it is there.
  std::filesystem::path folder;
  StudyShard shard;
  int threads = 1;
  std::function<void(const StudyProgress&)> progress;
  /// Told, in words, of each line of results that cannot be used, with its file and number.
  std::function<void(const std::string&)> warn;
};

/// Carries out the runs of the shard of which the folder has no result. `methods` are those of the
/// plan's study, in their order; `cases` those of the plan. Returns the runs of the plan by their
/// index, those of other shards only if the folder has them.
///
/// A run from a file has the same bits as the run that was written, so that a study that was ended
/// at any moment and begun again, or carried out in shards, has the same runs as one that ran
/// through, except for times and memory. A line is used only if it is whole and its fingerprint is
/// that of a run of the plan. An exception of a registration ends the work; what is done by then
/// remains. Throws InputError if the folder cannot be made or written to.
std::vector<std::optional<StudyRun>> carry_out(const StudyPlan& plan, const CaseSource& cases,
                                               const std::vector<Register>& methods,
                                               const StudyWork& work);

}  // namespace usct
