#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "us_ct_registration/phantom/tissue.h"

namespace usct::phantom {

/// The look of a surface to a camera: its colour (red, green, blue; linear, 0 to 1) and its gloss.
struct Look {
  Eigen::Vector3d colour;
  double gloss;
};

/// The surface of a tissue at a point that moves with the tissue: colours as in laparoscopic
/// videos, mottled, with small vessels in the capsule and over the tumour.
Look look_of(Tissue tissue, const Eigen::Vector3d& p_mm, std::uint64_t seed);

}  // namespace usct::phantom
