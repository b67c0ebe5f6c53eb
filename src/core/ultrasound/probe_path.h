#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/geometry/scan_geometry.h"

namespace usct {

/// If the middle of the field of view moves by more than this from one frame to the next, mm, a
/// hole is left between them.
constexpr double kHoleMm = 5.0;
/// No probe moves the middle of the field of view by more than this from one frame to the next, mm:
/// a pose is wrong.
constexpr double kJumpMm = 200.0;
/// How a hole comes about, for messages.
constexpr const char* kWhyHoles =
    "images or poses were lost on their way, or the probe moved too fast";

/// The middle of a frame's field of view, in frame coordinates, mm.
inline Eigen::Vector3d middle_of_field_mm(const AxialSampling& axial, const Array& array) {
  const Line line = line_in_frame(array, 0.5 * (line_count(array) - 1));
  return line.origin_mm + axial.depth_mm(0.5 * (axial.samples - 1)) * line.direction;
}

/// How far corners of the field of view, and ends of its middle line, lie apart in two frames at
/// most, mm.
double farthest_apart_mm(const BeamGrid& beams, int frame_a, int frame_b);

/// Throws InputError, naming `source`, if the middle of the field of view of a tracked sweep moves
/// by more than kJumpMm from one frame to the next. Frames are named by their numbers before those
/// of `left_out`, in ascending order, were left out.
void require_no_jump(const BeamGrid& beams, const std::string& source,
                     const std::vector<int>& left_out = {});

}  // namespace usct
