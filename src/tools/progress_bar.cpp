#include "progress_bar.h"

#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <memory>

namespace usct::tools {

namespace {

constexpr std::chrono::seconds kSilentWork{2};
constexpr int kBarWidth = 30;

void redraw(const std::string& label, double fraction) {
  const std::string filled(static_cast<std::size_t>(fraction * kBarWidth), '#');
  std::fprintf(stderr, "\r%s [%-*s] %3d %%%s", label.c_str(), kBarWidth, filled.c_str(),
               static_cast<int>(fraction * 100), fraction >= 1.0 ? "\n" : "");
}

}  // namespace

Progress progress_bar(const std::string& label, bool quiet) {
  if (quiet) return {};
  const bool terminal = isatty(STDERR_FILENO) != 0;
  const auto start = std::chrono::steady_clock::now();
  const auto last_step = std::make_shared<int>(-1);
  return [=](double fraction) {
    const int step = static_cast<int>(fraction * (terminal ? 100 : 10));
    if (step == *last_step) return;
    if (!terminal && std::chrono::steady_clock::now() - start < kSilentWork) return;
    *last_step = step;
    if (terminal)
      redraw(label, fraction);
    else
      std::fprintf(stderr, "%s: %d %%\n", label.c_str(), static_cast<int>(fraction * 100));
  };
}

}  // namespace usct::tools
