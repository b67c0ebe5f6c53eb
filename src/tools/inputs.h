#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/volume/volume.h"

namespace usct::tools {

/// Prints the warnings on standard error, one line each.
void print_warnings(const std::vector<std::string>& warnings);

/// Adds the options that a folder of DICOM files may need, the same in every subcommand. Returns
/// their group.
CLI::App* add_dicom_options(CLI::App& command, DicomReadOptions& options);

/// Reads a CT of any format. Warnings of the reader go to standard error.
CtVolume read_ct_with_warnings(const std::string& path, const DicomReadOptions& options = {},
                               const Progress& progress = {});

}  // namespace usct::tools
