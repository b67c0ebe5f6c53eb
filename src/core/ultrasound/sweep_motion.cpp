#include "ultrasound/sweep_motion.h"

#include <algorithm>

namespace usct {

SweepMotion::SweepMotion(const BeamGrid& beams)
    : beams_(beams),
      place_(moving_place(beams)),
      window_(std::clamp(beams.frames / 10, 1, std::max(1, beams.frames / 2 - 1))) {
  path_mm_.push_back(0.0);
  for (int f = 1; f < beams.frames; ++f)
    path_mm_.push_back(path_mm_.back() + (smoothed_place(f) - smoothed_place(f - 1)).norm());
  for (int f = 0; f < beams.frames; ++f) tangents_.push_back(tangent(f));
}

Beam SweepMotion::per_error(int frame, int line) const {
  const Beam per_mm = slope(frame, line);
  return {from_middle_mm(frame) * per_mm.origin_mm, from_middle_mm(frame) * per_mm.direction};
}

Beam SweepMotion::moved(int frame, int line, double error) const {
  if (!(path_mm_.back() > 0.0)) return beams_.beam(frame, line);  // nothing moves
  const double at_mm = path_mm(frame) + error * from_middle_mm(frame);
  const auto after = std::lower_bound(path_mm_.begin(), path_mm_.end(), at_mm);
  const int end = static_cast<int>(after - path_mm_.begin());
  Beam beam;
  if (end == 0 || end == beams_.frames) {
    const int last = end == 0 ? 0 : beams_.frames - 1;
    const Beam per_mm = slope(last, line);
    beam = beams_.beam(last, line);
    beam.origin_mm += (at_mm - path_mm(last)) * per_mm.origin_mm;
    beam.direction += (at_mm - path_mm(last)) * per_mm.direction;
  } else {
    const Beam& a = beams_.beam(end - 1, line);
    const Beam& b = beams_.beam(end, line);
    const double t = (at_mm - path_mm(end - 1)) / (path_mm(end) - path_mm(end - 1));
    beam.origin_mm = a.origin_mm + t * (b.origin_mm - a.origin_mm);
    beam.direction = a.direction + t * (b.direction - a.direction);
  }
  beam.direction.normalize();
  return beam;
}

Beam SweepMotion::slope(int frame, int line) const {
  Beam slope{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  for (const auto& [other, per_mm] : tangents_[static_cast<std::size_t>(frame)]) {
    const Beam& beam = beams_.beam(other, line);
    slope.origin_mm += per_mm * beam.origin_mm;
    slope.direction += per_mm * beam.direction;
  }
  return slope;
}

Eigen::Vector3d SweepMotion::smoothed_place(int frame) const {
  const int half = std::min({window_, frame, beams_.frames - 1 - frame});
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int f = frame - half; f <= frame + half; ++f)
    sum += beams_.point(f, place_.line, place_.sample);
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

BeamGrid with_sweep(const BeamGrid& beams, const AcquisitionErrors& errors) {
  const SweepMotion motion(beams);
  BeamGrid corrected = beams;
  corrected.corrected_sweep = true;
  for (int f = 0; f < beams.frames; ++f) {
    const double error = errors.sweep + motion.side(f) * errors.unevenness;
    for (int l = 0; l < beams.lines; ++l)
      corrected.beams[static_cast<std::size_t>(f * beams.lines + l)] = motion.moved(f, l, error);
  }
  return corrected;
}

}  // namespace usct
