#pragma once

#include <cstdint>

#include "us_ct_registration/volume/volume.h"

namespace usct {

/// Writes a slice of PackedVoxels::with_gradient, by the vector instructions of the machine. The
/// largest byte of a gradient is a change by the largest byte of a voxel within `per_mm`.
void write_with_gradient(const Volume<std::uint8_t>& bytes, int k, double per_mm,
                         std::uint32_t* words);

}  // namespace usct
