#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/geometry/scan_geometry.h"

/// A probe that moves while it acquires a sweep: each frame is seen from where the probe was then.
///
/// `T_us_then` has one pose per frame: that of the US frame at the time of the frame, in the US
/// frame at the time of the volume; `p_us = T_us_then[i] * p`, mm, where p is where the geometry of
/// the sweep alone has a point of frame i.
namespace usct {

/// Longest way by which `T_us_then` moves a sample of the grid, mm. Throws InputError unless there
/// is one pose per frame.
double probe_motion_mm(const BeamGrid& grid, const std::vector<Eigen::Isometry3d>& T_us_then);

/// Moves the beams of each frame by its pose. Throws InputError unless there is one per frame.
void follow_probe(const std::vector<Eigen::Isometry3d>& T_us_then, BeamGrid& grid);

/// The same for the geometry of a sweep, which becomes that of a tracked one: each frame has one
/// pose, a motorised one that of its middle line. Throws InputError unless there is one per frame.
ScanGeometry follow_probe(const std::vector<Eigen::Isometry3d>& T_us_then, ScanGeometry geometry);

}  // namespace usct
