#pragma once

#include <cstdint>
#include <string>

#include "io/bytes.h"

namespace usct::io {

enum class Compression { kZlib, kGzip };

/// Decompresses the bytes from `offset` on, which must give exactly `expected_size` bytes; a gzip
/// file may have several members.
///
/// Nothing is allocated on the word of a header: an expected size beyond what deflate can reach
/// (1032:1) is refused at once, and memory grows with what the data really give. Throws InputError,
/// naming `source`, if the data are damaged, end early, or give more or less.
Bytes decompress(const Bytes& bytes, std::size_t offset, std::uint64_t expected_size,
                 Compression compression, const std::string& source);

/// The same bytes for the same input (a gzip header without time stamp).
Bytes compress(const Bytes& bytes, Compression compression);

}  // namespace usct::io
