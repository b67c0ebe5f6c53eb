#pragma once

#include <string>

#include "io/bytes.h"
#include "us_ct_registration/io/ultrasound/ultrasonix.h"

/// Parses and writes the format of ultrasonix.h in memory. No files are opened, so that the parser
/// can be fuzzed.
namespace usct::io {

constexpr std::size_t kUltrasonixHeaderBytes = 76;  // 19 x int32

/// The header, checked against the size of the whole file, and the bytes before each frame (0 or
/// 4).
struct UltrasonixLayout {
  UltrasonixHeader header;
  std::uint64_t frame_bytes = 0;
  std::uint64_t tag_bytes = 0;
};

UltrasonixLayout parse_ultrasonix_header(const Bytes& prefix, std::uint64_t file_size,
                                         const std::string& source);

UltrasonixSequence parse_ultrasonix(Bytes bytes, const std::string& source);

Bytes format_ultrasonix(const UltrasonixSequence& sequence, const std::string& source);

}  // namespace usct::io
