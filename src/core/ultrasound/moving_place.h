#pragma once

#include "us_ct_registration/geometry/beam_grid.h"

namespace usct {

/// A line and a depth of a beam grid.
struct MeasuredPlace {
  int line = 0;
  double sample = 0.0;
};

/// The place at which the distance between neighbouring frames is measured: the middle line in the
/// middle of the depths, which stands for the whole field in straight sweeps and in fans. Where a
/// tracked probe turns about its middle line, or rocks about the middle of the depths, the field
/// moves more than three times as far from frame to frame at the median of places that are spread
/// over it; then it is the place of that median.
MeasuredPlace moving_place(const BeamGrid& beams);

/// Mean distances between neighbouring beams; 0 where there is only one line or frame.
struct BeamSpacing {
  double line_mm = 0.0;
  double frame_mm = 0.0;
};

/// The spacing of the lines in the middle of the depths of the middle frame, and that of the frames
/// at the moving place.
BeamSpacing mean_spacing_mm(const BeamGrid& beams);

}  // namespace usct
