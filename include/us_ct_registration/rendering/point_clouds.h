#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"
#include "us_ct_registration/volume/volume.h"

/// Ultrasound and CT as clouds of coloured points, for three-dimensional views.
namespace usct {

/// A point and the brightness (ultrasound) or HU (CT) there.
struct CloudPoint {
  Eigen::Vector3d p_mm;
  float intensity;
};

/// The samples of the middle frame and of the middle line of all frames: two fans that cross, in
/// the US frame. Along a line the points are at least `spacing_mm` apart.
std::vector<CloudPoint> crossed_fans(const BeamUltrasound& us, double spacing_mm);

/// The whole volume, in the US frame, averaged to about `spacing_mm` along lines and across them.
std::vector<CloudPoint> whole_volume(const BeamUltrasound& us, double spacing_mm);

/// The CT (HU) at the same points; points outside the CT are left out.
std::vector<CloudPoint> ct_at(const std::vector<CloudPoint>& points, const CtVolume& ct,
                              const Eigen::Isometry3d& T_ct_points);

/// A frame near the acquired images, mm: for a motorised probe the US frame itself; for a tracked
/// sweep, whose US frame is the tracker's and may be far away, the frame of its middle image.
Eigen::Isometry3d T_us_acquired(const ScanGeometry& geometry);

/// Frame at the middle sample of the middle line of the middle frame, with the axes of
/// `T_us_acquired`, mm.
Eigen::Isometry3d T_us_field(const ScanGeometry& geometry);

}  // namespace usct
