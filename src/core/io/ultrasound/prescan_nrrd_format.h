#pragma once

#include <functional>
#include <string>

#include "io/bytes.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"

/// Parses and writes the format of prescan_nrrd.h in memory. No files are opened, so that the
/// parser can be fuzzed.
namespace usct::io {

/// Returns the bytes of the detached data file of this name.
using ReadDetached = std::function<Bytes(const std::string& name)>;

PreScanVolume parse_prescan_nrrd(Bytes bytes, const std::string& source,
                                 const ReadDetached& read_detached);

Bytes format_prescan_nrrd(const PreScanVolume& volume);

}  // namespace usct::io
