#include "ultrasound/probe_path.h"

#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"

namespace usct {

void require_no_jump(const BeamGrid& beams, const std::string& source) {
  if (!beams.tracked) return;
  const auto middle_us_mm = [&](int frame) {
    return beams.point(frame, beams.lines / 2, 0.5 * (beams.samples() - 1));
  };
  for (int frame = 1; frame < beams.frames; ++frame) {
    const double step_mm = (middle_us_mm(frame) - middle_us_mm(frame - 1)).norm();
    if (step_mm <= kJumpMm) continue;
    throw InputError(source, "frames " + std::to_string(frame - 1) + " and " +
                                 std::to_string(frame) + " lie " + formatted("%.0f", step_mm) +
                                 " mm apart, must lie at most " + formatted("%g", kJumpMm) +
                                 " mm apart: the tracker's pose of one of them is wrong");
  }
}

}  // namespace usct
