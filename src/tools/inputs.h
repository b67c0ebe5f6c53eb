#pragma once

#include <string>
#include <vector>

#include "us_ct_registration/io/dicom.h"
#include "us_ct_registration/volume/volume.h"

namespace usct::tools {

/// On standard error, one line each.
void print_warnings(const std::vector<std::string>& warnings);

/// A CT of any format; the reader's warnings go to standard error.
CtVolume read_ct_with_warnings(const std::string& path, const DicomReadOptions& options = {},
                               const Progress& progress = {});

}  // namespace usct::tools
