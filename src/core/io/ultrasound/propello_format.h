#pragma once

#include <string>

#include "io/bytes.h"
#include "us_ct_registration/io/ultrasound/propello.h"

/// The format of propello.h in memory, without files (and therefore open to fuzzing).
namespace usct::io {

constexpr std::size_t kPropelloHeaderBytes = 28;  // 7 x int32

/// The header, checked against the size of the whole file.
PropelloHeader parse_propello_header(const Bytes& prefix, std::uint64_t file_size,
                                     const std::string& source);

PropelloVolumes parse_propello(Bytes bytes, const std::string& source);

Bytes format_propello(const PropelloVolumes& volumes, const std::string& source);

}  // namespace usct::io
