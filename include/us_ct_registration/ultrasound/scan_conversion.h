#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/progress.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/volume/sampling.h"
#include "us_ct_registration/volume/volume.h"

namespace usct {

/// Ultrasound on a Cartesian grid in the US frame, with a mask: 255 where the brightness is known,
/// 0 (with brightness 0) where it is not.
struct ScanConverted {
  UsVolume volume;
  MaskVolume mask;
};

/// The box along the axes of the US frame, mm, that holds all beams and the half sample, half line
/// and half frame around them that scan conversion fills (a tracked sweep has no half frames).
/// Throws InputError if the geometry is invalid.
Eigen::AlignedBox3d field_of_view(const ScanGeometry& geometry);

/// The smallest isotropic grid that covers the field of view. Throws InputError if the geometry or
/// spacing is invalid.
Grid fan_grid(const ScanGeometry& geometry, double spacing_mm);

/// Scan conversion of a motorised sweep (thesis 4.2): every voxel is mapped back to (sample, line,
/// frame) by the exact inverse of eqs 4.11-4.14 and interpolated between the recorded samples.
///
/// A sample represents half a sample, half a line and half a frame around itself. Voxels in that
/// range are in the mask; beyond the centres of the outermost samples the edge value is repeated.
/// Nothing else is extrapolated. The grid may have any orientation; rows along the x axis of the US
/// frame are faster. Throws InputError if the volume or grid is invalid or the sweep is a tracked
/// one (see compounding.h).
ScanConverted scan_convert(const PreScanVolume& prescan, const Grid& grid,
                           Interpolation interpolation, const Progress& progress = {});

/// Inverse scan conversion (thesis 4.3, eqs 4.15-4.18): samples a Cartesian volume, such as a CT,
/// along the beams. Returns samples x lines x frames, samples fastest. `T_volume_us` maps the US
/// frame to the frame of the volume (it combines the manual offsets and the six parameters of the
/// thesis).
template <typename T>
std::vector<float> sample_along_beams(const Volume<T>& volume, const BeamGrid& beams,
                                      const Eigen::Isometry3d& T_volume_us,
                                      Interpolation interpolation, Outside outside,
                                      const Progress& progress = {});

}  // namespace usct
