#pragma once

#include <optional>

#include "io/dicom/dicom_codecs.h"

namespace usct::io {

/// JPEG, JPEG-LS and JPEG 2000 by GDCM, a module (module.h).
struct GdcmCodecs {
  static constexpr const char* kModule = "gdcm";

  /// The stored values of a frame whose stream has been checked; unset if it is damaged.
  /// `is_jpeg_12` says that it is JPEG of 12 bits.
  std::optional<std::vector<std::uint8_t>> (*decode)(const std::string& transfer_syntax_uid,
                                                     const FrameFormat& format, bool is_jpeg_12,
                                                     const std::vector<std::uint8_t>& stream);
};

}  // namespace usct::io
