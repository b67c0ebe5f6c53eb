#pragma once

#include <cstdint>
#include <string>
#include <vector>

/// Decodes the compressed frames of DICOM files.
namespace usct::io {

/// The format of a frame as the header of its file states it.
struct FrameFormat {
  int columns = 0;
  int rows = 0;
  int bits_allocated = 0;
  int bits_stored = 0;
  bool is_signed = false;

  std::size_t bytes() const {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows) *
           static_cast<std::size_t>(bits_allocated / 8);
  }
};

/// The stored values of a frame, little-endian. The size that the compressed stream itself states
/// is checked against the header before memory is allocated. Throws InputError, naming `source`,
/// for a stream that is cut short, damaged or of another size, and for a transfer syntax that is
/// not known.
std::vector<std::uint8_t> decompress_frame(const std::string& source,
                                           const std::string& transfer_syntax_uid,
                                           const FrameFormat& format,
                                           const std::vector<std::uint8_t>& stream);

}  // namespace usct::io
