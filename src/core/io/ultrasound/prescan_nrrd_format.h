#pragma once

#include <functional>
#include <string>

#include "io/bytes.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"

/// The format of prescan_nrrd.h in memory, without files (and therefore open to fuzzing).
namespace usct::io {

/// Gives the bytes of a detached data file of this name.
using ReadDetached = std::function<Bytes(const std::string& name)>;

PreScanVolume parse_prescan_nrrd(Bytes bytes, const std::string& source,
                                 const ReadDetached& read_detached);

Bytes format_prescan_nrrd(const PreScanVolume& volume);

}  // namespace usct::io
