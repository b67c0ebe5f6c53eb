#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "us_ct_registration/io/dicom/dicom.h"
#include "us_ct_registration/volume/volume.h"

namespace usct::tools {

/// On standard error, one line each.
void print_warnings(const std::vector<std::string>& warnings);

/// Options for what a folder of DICOM files leaves open; the same in every subcommand.
void add_dicom_options(CLI::App& command, DicomReadOptions& options);

/// A CT of any format; the reader's warnings go to standard error.
CtVolume read_ct_with_warnings(const std::string& path, const DicomReadOptions& options = {},
                               const Progress& progress = {});

}  // namespace usct::tools
