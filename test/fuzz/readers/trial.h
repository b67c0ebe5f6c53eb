#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "readers.h"

namespace usct::fuzz {

struct TrialOptions {
  std::uint64_t runs = 1000;
  /// Longest time, s.
  double seconds = 1e9;
  std::uint64_t seed = 1;
  /// A run that takes longer counts as a hang, s.
  unsigned hang_s = 20;
  /// Growth of the memory of the process over the second half of the runs that counts as a leak,
  /// MiB.
  double leak_mib = 64.0;
  /// Folder that gets the files that went wrong; nothing is kept if it is empty.
  std::filesystem::path keep;
};

/// The outcome of many runs of one reader.
struct Trial {
  std::uint64_t runs = 0;
  std::uint64_t accepted = 0;
  double seconds = 0.0;
  /// Refusals that differ by more than numbers and names.
  std::size_t refusals = 0;
  double growth_mib = 0.0;
  /// Descriptions of the faults found: a crash, a hang, an exception other than InputError, an
  /// error that does not name the file, a leak.
  std::vector<std::string> faults;
};

/// Reads mutated files in processes of their own, so that a crash ends one of them only and is
/// reported; another goes on. Files that are accepted or refused for a new reason join the corpus
/// from which later ones are made.
Trial run_trial(const Reader& reader, const TrialOptions& options);

}  // namespace usct::fuzz
