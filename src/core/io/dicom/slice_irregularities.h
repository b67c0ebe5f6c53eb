#pragma once

#include <vector>

#include "io/dicom/slice_stack.h"

/// Descriptions, for messages, of the deviations of ordered slices from a regular grid.
namespace usct::io {

/// Adds to `stack.irregular` the missing slices, or the variation of the slice spacing, and sets
/// `stack.least_spacing_mm`. The spacing must vary by more than `tolerance`, a fraction of it.
void report_uneven(const std::vector<SlicePose>& slices, double tolerance, SliceStack& stack);

/// Adds to `stack.irregular` the tilt of the gantry if the sideways shifts are in proportion to the
/// depth. If they are not, within `tolerance_mm`, it adds the slice with the largest deviation.
void report_shifted(const std::vector<SlicePose>& slices, double tolerance_mm, SliceStack& stack);

}  // namespace usct::io
