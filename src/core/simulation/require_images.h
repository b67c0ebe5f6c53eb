#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <string>

#include "simulation/require.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// Throws InputError, naming `source`, unless `T` is a finite rotation and translation.
inline void require_rigid(const Eigen::Isometry3d& T, const std::string& source = "T_ct_us") {
  constexpr double kTolerance = 1e-6;
  const Eigen::Matrix3d R = T.linear();
  if (!T.matrix().allFinite() ||
      !(R.transpose() * R).isApprox(Eigen::Matrix3d::Identity(), kTolerance) ||
      R.determinant() < 0.0)
    throw InputError(source, "is not a finite rotation and translation");
}

/// Throws InputError unless there are samples, and as many beams as lines and frames say, finite
/// and with directions of unit length.
inline void require_beams(const BeamGrid& beams) {
  require(beams.samples() > 0, "beam grid", "samples", beams.samples(), "> 0");
  require(is_positive(beams.axial.spacing_mm), "beam grid", "spacing_mm", beams.axial.spacing_mm,
          "> 0");
  require(std::isfinite(beams.axial.start_depth_mm), "beam grid", "start_depth_mm",
          beams.axial.start_depth_mm, "finite");
  require(beams.lines > 0, "beam grid", "lines", beams.lines, "> 0");
  require(beams.frames > 0, "beam grid", "frames", beams.frames, "> 0");
  require(beams.beams.size() ==
              static_cast<std::size_t>(beams.lines) * static_cast<std::size_t>(beams.frames),
          "beam grid", "beams", static_cast<double>(beams.beams.size()), "lines x frames");
  constexpr double kTolerance = 1e-3;
  for (std::size_t i = 0; i < beams.beams.size(); ++i) {
    const Beam& beam = beams.beams[i];
    if (!beam.origin_mm.allFinite() || !(std::abs(beam.direction.norm() - 1.0) < kTolerance))
      throw InputError("beam grid", "beam " + std::to_string(i) +
                                        " must have a finite origin and a direction of length 1");
  }
}

/// Throws InputError unless the grid is valid and the voxels are as many as it has.
inline void require_ct(const CtVolume& ct) {
  ct.grid.validate("CT");
  require(ct.voxels.size() == ct.grid.voxel_count(), "CT", "voxels",
          static_cast<double>(ct.voxels.size()), "as many as the grid has");
}

}  // namespace usct
