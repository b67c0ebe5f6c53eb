#include "similarity/sweep_motion.h"

#include <algorithm>

namespace usct {

SweepMotion::SweepMotion(const BeamGrid& beams)
    : beams_(beams), window_(std::clamp(beams.frames / 10, 1, std::max(1, beams.frames / 2 - 1))) {
  path_mm_.push_back(0.0);
  for (int f = 1; f < beams.frames; ++f)
    path_mm_.push_back(path_mm_.back() + (smoothed_centre(f) - smoothed_centre(f - 1)).norm());
  for (int f = 0; f < beams.frames; ++f) tangents_.push_back(tangent(f));
}

Beam SweepMotion::operator()(int frame, int line) const {
  Beam motion{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  const double from_middle_mm = path_mm(frame) - 0.5 * path_mm_.back();
  for (const auto& [other, per_mm] : tangents_[static_cast<std::size_t>(frame)]) {
    const Beam& beam = beams_.beam(other, line);
    motion.origin_mm += from_middle_mm * per_mm * beam.origin_mm;
    motion.direction += from_middle_mm * per_mm * beam.direction;
  }
  return motion;
}

Eigen::Vector3d SweepMotion::smoothed_centre(int frame) const {
  const int half = std::min({window_, frame, beams_.frames - 1 - frame});
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int f = frame - half; f <= frame + half; ++f)
    sum += beams_.point(f, beams_.lines / 2, 0.5 * beams_.samples());
  return sum / (2 * half + 1);
}

SweepMotion::Tangent SweepMotion::tangent(int frame) const {
  const int last = beams_.frames - 1;
  const int margin = std::min(window_, last / 2);
  const int middle = std::clamp(frame, margin, last - margin);
  const int a = std::max(0, middle - window_);
  const int c = std::min(last, middle + window_);
  const double at = path_mm(frame), at_a = path_mm(a), at_b = path_mm(middle), at_c = path_mm(c);
  if (!(at_c > at_a)) return {};
  if (!(at_b > at_a && at_c > at_b)) return {{a, -1.0 / (at_c - at_a)}, {c, 1.0 / (at_c - at_a)}};
  return {{a, (2.0 * at - at_b - at_c) / ((at_a - at_b) * (at_a - at_c))},
          {middle, (2.0 * at - at_a - at_c) / ((at_b - at_a) * (at_b - at_c))},
          {c, (2.0 * at - at_a - at_b) / ((at_c - at_a) * (at_c - at_b))}};
}

}  // namespace usct
