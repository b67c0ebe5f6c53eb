#include "evaluation/peak_memory.h"

#include <malloc.h>

#include <algorithm>
#include <fstream>
#include <string>

namespace usct {
namespace {

constexpr double kKibPerMib = 1024.0;

/// A line of /proc/self/status, such as "VmHWM:   1234 kB", in MiB.
std::optional<double> status_mib(const std::string& key) {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    double kib = 0.0;
    if (word == key + ":" && status >> kib) return kib / kKibPerMib;
  }
  return std::nullopt;
}

/// Sets the peak to what the process holds now.
bool reset_peak() {
  std::ofstream clear("/proc/self/clear_refs");
  clear << "5" << std::flush;
  return clear.good();
}

}  // namespace

PeakMemory::PeakMemory() {
  // Memory that earlier work has freed would otherwise count as held, and the peak would not rise.
  malloc_trim(0);
  if (reset_peak()) before_mib_ = status_mib("VmRSS");
}

std::optional<double> PeakMemory::mib() const {
  const std::optional<double> peak_mib = status_mib("VmHWM");
  if (!before_mib_ || !peak_mib) return std::nullopt;
  return std::max(0.0, *peak_mib - *before_mib_);
}

}  // namespace usct
