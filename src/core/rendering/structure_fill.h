#pragma once

#include <cstddef>
#include <cstdint>

namespace usct::rendering {

/// How a structure is filled. Its depth behind the first surface is d = 1/v - 1/f, with its own
/// 1 / z of v and the first surface's f, and its weight falls from `opacity` as s / (s + d), with s
/// the `hidden_depth_mm`.
struct StructureFill {
  std::uint8_t colour[3];  // in the order of the image's channels
  double opacity;          // [0, 1]
  double hidden_depth_mm;
};

/// Mixes a structure into `count` pixels of a row, of 3 channels of 8 bits each. `inverse_mm` and
/// `first_mm` are v and f of the pixels (1/mm; v <= f, and 0 where nothing is covered). Returns how
/// many pixels the structure covers.
std::size_t fill_structure(std::uint8_t* pixels, const float* inverse_mm, const float* first_mm,
                           std::size_t count, const StructureFill& fill);

}  // namespace usct::rendering
