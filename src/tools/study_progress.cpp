#include "study_progress.h"

#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>

#include "us_ct_registration/formatted.h"

namespace usct::tools {
namespace {

std::string duration(double seconds) {
  constexpr double kMinute = 60.0;
  constexpr double kHour = 3600.0;
  if (!std::isfinite(seconds)) return "unknown time";
  if (seconds < kMinute) return formatted("%.0f s", seconds);
  if (seconds < kHour) return formatted("%.0f min", seconds / kMinute);
  return formatted("%.1f h", seconds / kHour);
}

}  // namespace

std::function<void(const StudyProgress&)> study_progress(bool quiet) {
  if (quiet) return {};
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::seconds kBetweenLines{30};
  const bool terminal = isatty(STDERR_FILENO) != 0;
  const auto next_line = std::make_shared<Clock::time_point>();
  return [=](const StudyProgress& progress) {
    const bool last = progress.done == progress.all;
    if (!terminal && !last && Clock::now() < *next_line) return;
    *next_line = Clock::now() + kBetweenLines;
    const std::string left = last ? "" : ", " + duration(progress.seconds_left) + " left";
    std::fprintf(stderr, "%sstudy: %zu of %zu runs%s%s", terminal ? "\r\033[K" : "", progress.done,
                 progress.all, left.c_str(), terminal && !last ? "" : "\n");
    std::fflush(stderr);
  };
}

}  // namespace usct::tools
