#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "phantom/tissue_raster.h"

namespace usct::phantom {

/// A scatterer, much smaller than a wavelength, in the probe frame.
struct Scatterer {
  Eigen::Vector3f p_mm;
  float amplitude;  // root of mm^3: energy 1 per mm^3 is renal cortex
};

/// A piece of an interface between two tissues, in the probe frame.
struct SurfaceScatterer {
  Eigen::Vector3f p_mm;
  Eigen::Vector3f normal;  // unit length; zero if unknown
  /// Reflection coefficient times the area that the scatterer represents, mm^2; for a ball, level
  /// of its echo at the focus.
  float amplitude;
  /// Radius of the ball; 0 for a piece of interface.
  float ball_radius_mm = 0.0F;
  bool is_gas = false;
  /// Whether the material is bone, gas, stone or steel, whose side lobes are visible.
  bool is_strong = false;
  std::uint32_t hash = 0;
};

/// All scatterers that beams can meet, grouped by blocks of the raster (in its order).
struct ScattererField {
  struct Block {
    Eigen::Vector3f centre_mm;  // in the probe frame
    float radius_mm;
    std::vector<Scatterer> volume;
    std::vector<SurfaceScatterer> surface;
  };
  std::vector<Block> blocks;
};

/// `per_cell` volume scatterers in each lattice cell, jittered, their strength scaled by the local
/// echogenicity with `echo_texture_db` of texture; one surface scatterer per cell that an interface
/// crosses. All depend on seed and cell only, so that they do not move with the sweep.
ScattererField make_scatterers(const ScannedBody& body, const TissueRaster& raster, int per_cell,
                               double echo_texture_db, std::uint64_t seed,
                               const Progress& progress);

}  // namespace usct::phantom
