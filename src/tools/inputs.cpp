#include "inputs.h"

#include <cstdio>

namespace usct::tools {

void print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings)
    std::fprintf(stderr, "usct: warning: %s\n", warning.c_str());
}

CtVolume read_ct_with_warnings(const std::string& path, const DicomReadOptions& options,
                               const Progress& progress) {
  LoadedCt ct = read_ct(path, options, progress);
  print_warnings(ct.warnings);
  return std::move(ct.volume);
}

}  // namespace usct::tools
