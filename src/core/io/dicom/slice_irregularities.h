#pragma once

#include <vector>

#include "io/dicom/slice_stack.h"

/// What keeps ordered slices from lying on a regular grid, in words that name slices and
/// millimetres.
namespace usct::io {

/// Adds to `stack.irregular` which slices are missing, or how the slice spacing varies, and sets
/// `stack.least_spacing_mm`. The spacing must vary by more than `tolerance`, a fraction of it.
void report_uneven(const std::vector<SlicePose>& slices, double tolerance, SliceStack& stack);

/// Adds to `stack.irregular` by how much the gantry was tilted: then the sideways shifts are in
/// proportion to the depth. If they are not, within `tolerance_mm`, the slice that is off most is
/// named.
void report_shifted(const std::vector<SlicePose>& slices, double tolerance_mm, SliceStack& stack);

}  // namespace usct::io
