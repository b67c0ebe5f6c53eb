#pragma once

#include <cstdint>
#include <string>

#include "io/bytes.h"

namespace usct::io {

enum class Compression { kZlib, kGzip };

/// Decompresses the bytes from `offset` on, which must give exactly `expected_size` bytes; a gzip
/// file may have several members.
///
/// A wrong size in a header cannot exhaust memory: an expected size beyond the largest compression
/// ratio of deflate (1032:1) is refused at once, and memory grows with the decompressed data.
/// Throws InputError, naming `source`, if the data are damaged, end early, or have another size.
Bytes decompress(const Bytes& bytes, std::size_t offset, std::uint64_t expected_size,
                 Compression compression, const std::string& source);

/// Compresses. The gzip header holds no time stamp, so that the same input gives the same bytes.
Bytes compress(const Bytes& bytes, Compression compression);

}  // namespace usct::io
