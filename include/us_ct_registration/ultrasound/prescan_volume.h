#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/scan_geometry.h"

namespace usct {

/// 3D ultrasound before scan conversion: 8-bit B-mode brightness, samples x lines x frames (samples
/// fastest), with its geometry.
struct PreScanVolume {
  ScanGeometry geometry;
  std::vector<std::uint8_t> voxels;
  /// Time of acquisition, ISO 8601 in UTC; empty if unknown.
  std::string acquisition_time;

  std::size_t offset(int sample, int line, int frame) const {
    return (static_cast<std::size_t>(frame) * static_cast<std::size_t>(geometry.lines()) +
            static_cast<std::size_t>(line)) *
               static_cast<std::size_t>(geometry.samples()) +
           static_cast<std::size_t>(sample);
  }
  std::uint8_t at(int sample, int line, int frame) const {
    return voxels[offset(sample, line, frame)];
  }

  /// Throws InputError, naming `source`, if the geometry is invalid or the number of voxels is not
  /// samples x lines x frames.
  void validate(const std::string& source) const;
};

}  // namespace usct
