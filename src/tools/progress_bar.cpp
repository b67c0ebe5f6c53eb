#include "progress_bar.h"

#include <unistd.h>

#include <cstdio>
#include <memory>

namespace usct::tools {

Progress progress_bar(const std::string& label, bool quiet) {
  if (quiet) return {};
  const bool terminal = isatty(STDERR_FILENO) != 0;
  const auto last_step = std::make_shared<int>(-1);
  return [=](double fraction) {
    const int steps = terminal ? 100 : 10;
    const int step = static_cast<int>(fraction * steps);
    if (step == *last_step) return;
    *last_step = step;
    const std::string filled(static_cast<std::size_t>(fraction * 30), '#');
    if (terminal)
      std::fprintf(stderr, "\r%s [%-30s] %3d %%%s", label.c_str(), filled.c_str(),
                   static_cast<int>(fraction * 100), fraction >= 1.0 ? "\n" : "");
    else
      std::fprintf(stderr, "%s: %d %%\n", label.c_str(), static_cast<int>(fraction * 100));
  };
}

}  // namespace usct::tools
