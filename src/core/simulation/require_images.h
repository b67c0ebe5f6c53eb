#pragma once

#include <Eigen/Geometry>

#include "simulation/require.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// Throws InputError unless `T` is a finite rotation and translation.
inline void require_rigid(const Eigen::Isometry3d& T) {
  constexpr double kTolerance = 1e-6;
  const Eigen::Matrix3d R = T.linear();
  if (!T.matrix().allFinite() ||
      !(R.transpose() * R).isApprox(Eigen::Matrix3d::Identity(), kTolerance) ||
      R.determinant() < 0.0)
    throw InputError("T_ct_us", "is not a finite rotation and translation");
}

/// Throws InputError unless there are samples, and as many beams as lines and frames say.
inline void require_beams(const BeamGrid& beams) {
  require(beams.samples() > 0, "beam grid", "samples", beams.samples(), "> 0");
  require(is_positive(beams.axial.spacing_mm), "beam grid", "spacing_mm", beams.axial.spacing_mm,
          "> 0");
  require(beams.lines > 0, "beam grid", "lines", beams.lines, "> 0");
  require(beams.frames > 0, "beam grid", "frames", beams.frames, "> 0");
  require(beams.beams.size() ==
              static_cast<std::size_t>(beams.lines) * static_cast<std::size_t>(beams.frames),
          "beam grid", "beams", static_cast<double>(beams.beams.size()), "lines x frames");
}

/// Throws InputError unless the grid is valid and the voxels are as many as it has.
inline void require_ct(const CtVolume& ct) {
  ct.grid.validate("CT");
  require(ct.voxels.size() == ct.grid.voxel_count(), "CT", "voxels",
          static_cast<double>(ct.voxels.size()), "as many as the grid has");
}

}  // namespace usct
