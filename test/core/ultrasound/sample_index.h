#pragma once

#include <cstddef>

#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct::test {

/// The index of a sample in values of a grid of beams.
inline std::size_t at(const BeamGrid& beams, int sample, int line, int frame) {
  return (static_cast<std::size_t>(frame) * static_cast<std::size_t>(beams.lines) +
          static_cast<std::size_t>(line)) *
             static_cast<std::size_t>(beams.samples()) +
         static_cast<std::size_t>(sample);
}

}  // namespace usct::test
