#pragma once

#include "core/registration/symmetric_sweeps.h"

/// Tracked sweeps that move the middle of the field of view little or not at all. Lines are 1 mm
/// apart, and samples 1.5 mm.
namespace usct::test {

/// The frames of a sweep that stays at one place, moved.
template <typename MotionOf>
BeamGrid moved_frames(int samples, int lines, int frames, const MotionOf& motion_of) {
  BeamGrid beams = straight_tracked(samples, lines, frames, 0.0);
  for (int frame = 0; frame < frames; ++frame) {
    const Eigen::Isometry3d motion = motion_of(frame);
    for (int line = 0; line < lines; ++line) {
      Beam& beam = beams.beams[static_cast<std::size_t>(frame * lines + line)];
      beam = {motion * beam.origin_mm, motion.linear() * beam.direction};
    }
  }
  return beams;
}

/// A probe that turns about its middle line by `step_rad` from frame to frame.
inline BeamGrid turning_sweep(int samples, int lines, int frames, double step_rad) {
  return moved_frames(samples, lines, frames, [&](int frame) {
    return Eigen::Isometry3d(Eigen::AngleAxisd(step_rad * frame, Eigen::Vector3d::UnitY()));
  });
}

/// A probe that rocks across its frames about an axis so deep below the first sample.
inline BeamGrid rocking_sweep(int samples, int lines, int frames, double step_rad,
                              double depth_mm) {
  const double first_mm = straight_tracked(samples, lines, frames, 0.0).axial.start_depth_mm;
  const Eigen::Translation3d to_axis(0.0, first_mm + depth_mm, 0.0);
  return moved_frames(samples, lines, frames, [&](int frame) {
    return to_axis * Eigen::AngleAxisd(step_rad * frame, Eigen::Vector3d::UnitX()) *
           to_axis.inverse();
  });
}

}  // namespace usct::test
