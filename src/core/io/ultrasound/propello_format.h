#pragma once

#include <string>

#include "io/bytes.h"
#include "us_ct_registration/io/ultrasound/propello.h"

/// Parses and writes the format of propello.h in memory. No files are opened, so that the parser
/// can be fuzzed.
namespace usct::io {

constexpr std::size_t kPropelloHeaderBytes = 28;  // 7 x int32

/// Parses the header and checks it against the size of the whole file.
PropelloHeader parse_propello_header(const Bytes& prefix, std::uint64_t file_size,
                                     const std::string& source);

PropelloVolumes parse_propello(Bytes bytes, const std::string& source);

Bytes format_propello(const PropelloVolumes& volumes, const std::string& source);

}  // namespace usct::io
