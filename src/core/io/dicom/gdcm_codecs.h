#pragma once

#include <optional>

#include "io/dicom/dicom_codecs.h"

namespace usct::io {

/// JPEG, JPEG-LS and JPEG 2000 by GDCM, a module (module.h).
struct GdcmCodecs {
  static constexpr const char* kModule = "gdcm";

  /// The stored values of a frame whose stream has been checked; unset if it is damaged.
  std::optional<std::vector<std::uint8_t>> (*decode)(const std::string& transfer_syntax_uid,
                                                     const FrameFormat& format,
                                                     const std::vector<std::uint8_t>& stream);
};

}  // namespace usct::io
