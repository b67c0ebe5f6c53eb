#include "ultrasound/probe_path.h"

#include <algorithm>

#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"

namespace usct {
namespace {

/// The number that a frame had before others were left out.
int number_before(int frame, const std::vector<int>& left_out) {
  for (const int left : left_out)
    if (left <= frame) ++frame;
  return frame;
}

}  // namespace

double farthest_apart_mm(const BeamGrid& beams, int frame_a, int frame_b) {
  double most_mm = 0.0;
  for (const int line : {0, beams.lines / 2, beams.lines - 1})
    for (const int sample : {0, beams.samples() - 1})
      most_mm = std::max(
          most_mm,
          (beams.point(frame_a, line, sample) - beams.point(frame_b, line, sample)).norm());
  return most_mm;
}

void require_no_jump(const BeamGrid& beams, const std::string& source,
                     const std::vector<int>& left_out) {
  if (!beams.tracked) return;
  const auto middle_us_mm = [&](int frame) {
    return beams.point(frame, beams.lines / 2, 0.5 * (beams.samples() - 1));
  };
  for (int frame = 1; frame < beams.frames; ++frame) {
    const double step_mm = (middle_us_mm(frame) - middle_us_mm(frame - 1)).norm();
    if (step_mm <= kJumpMm) continue;
    throw InputError(source, "frames " + std::to_string(number_before(frame - 1, left_out)) +
                                 " and " + std::to_string(number_before(frame, left_out)) +
                                 " lie " + formatted("%.0f", step_mm) +
                                 " mm apart, must lie at most " + formatted("%g", kJumpMm) +
                                 " mm apart: the tracker's pose of one of them is wrong");
  }
}

}  // namespace usct
