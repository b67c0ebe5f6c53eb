#include "inputs.h"

#include <cstdio>

namespace usct::tools {

void print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings)
    std::fprintf(stderr, "usct: warning: %s\n", warning.c_str());
}

CLI::App* add_dicom_options(CLI::App& command, DicomReadOptions& options) {
  CLI::App* group = command.add_option_group("DICOM");
  group->add_option("--series", options.series_uid,
                    "SeriesInstanceUID, where a folder holds several CT series");
  group->add_option("--acquisition", options.acquisition_number,
                    "AcquisitionNumber, where a series holds several scans of the same place");
  group->add_flag("--resample-irregular", options.resample_irregular,
                  "resample gantry tilt, uneven and missing slices onto a regular grid instead of "
                  "refusing them");
  return group;
}

CtVolume read_ct_with_warnings(const std::string& path, const DicomReadOptions& options,
                               const Progress& progress) {
  LoadedCt ct = read_ct(path, options, progress);
  print_warnings(ct.warnings);
  return std::move(ct.volume);
}

}  // namespace usct::tools
