#pragma once

#include <complex>
#include <cstdint>
#include <vector>

#include "phantom/transmission.h"
#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/phantom/ultrasound_options.h"

namespace usct::phantom {

/// Turns the echoes of a frame into an envelope, as a scanner does: with electronic noise, gain and
/// its errors, haze, ring-down near the array and lines without contact.
class Receiver {
 public:
  /// `transmissions` are those of all frames; the operator's TGC follows from them.
  Receiver(const UltrasoundOptions& options, double frequency_mhz, const ScanGeometry& geometry,
           const std::vector<TransmissionMap>& transmissions, std::uint64_t seed);

  /// Envelope, lines x samples; renal cortex is about 1 if gain and TGC are right.
  std::vector<float> envelope(std::vector<std::complex<float>> echoes, int frame) const;

 private:
  double line_gain_error_db(int frame, int line) const;
  void add_haze(std::vector<std::complex<float>>& signal, int frame) const;
  int lines_without_contact(int frame) const;
  std::size_t offset(int line, int sample) const {
    return static_cast<std::size_t>(line) * static_cast<std::size_t>(samples_) +
           static_cast<std::size_t>(sample);
  }

  UltrasoundOptions options_;
  std::uint64_t seed_;
  int lines_;
  int samples_;
  double spacing_mm_;
  float noise_level_;
  bool no_contact_at_end_;
  std::vector<double> tgc_db_;                  // per sample
  std::vector<std::complex<float>> ring_down_;  // lines x samples
};

/// Grey values of an envelope: `cortex_grey` at level 1, 255 per `dynamic_range_db`.
std::vector<std::uint8_t> compress(const std::vector<float>& envelope,
                                   const UltrasoundOptions& options);

}  // namespace usct::phantom
