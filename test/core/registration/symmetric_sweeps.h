#pragma once

#include <algorithm>

#include "core/geometry/random_geometry.h"
#include "us_ct_registration/geometry/beam_grid.h"

/// Beams that are their own mirror image, where the effect of reversed lines and frames is known.
namespace usct::test {

/// A motorised sweep with symmetric angles.
inline BeamGrid symmetric_motorised(int samples, int lines, int frames, double line_pitch_rad,
                                    double frame_pitch_rad) {
  ScanGeometry geometry;
  geometry.axial = {samples, 3.0, 1.5};
  geometry.array = CurvilinearArray{40.0, centred_table(lines, line_pitch_rad)};
  geometry.motion = MotorSweep{27.25, centred_table(frames, frame_pitch_rad), 0.0};
  return beam_grid(geometry);
}

/// A straight sweep of a tracked linear probe, frames `step_mm` apart along z.
inline BeamGrid straight_tracked(int samples, int lines, int frames, double step_mm) {
  ScanGeometry geometry;
  geometry.axial = {samples, 3.0, 1.5};
  geometry.array = LinearArray{centred_table(lines, 1.0)};
  TrackedSweep sweep;
  for (const double z : centred_table(frames, step_mm))
    sweep.T_us_frame.emplace_back(Eigen::Translation3d(0.0, 0.0, z));
  geometry.motion = sweep;
  return beam_grid(geometry);
}

/// The greatest distance between the same samples of two sweeps, mm.
inline double greatest_distance_mm(const BeamGrid& a, const BeamGrid& b) {
  double most_mm = 0.0;
  for (int f = 0; f < a.frames; ++f)
    for (int l = 0; l < a.lines; ++l)
      for (const int s : {0, a.samples() - 1})
        most_mm = std::max(most_mm, (a.point(f, l, s) - b.point(f, l, s)).norm());
  return most_mm;
}

inline Eigen::Vector3d middle_of_samples(const BeamGrid& beams) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int f = 0; f < beams.frames; ++f)
    for (int l = 0; l < beams.lines; ++l) sum += beams.point(f, l, 0.5 * (beams.samples() - 1));
  return sum / (static_cast<double>(beams.frames) * beams.lines);
}

}  // namespace usct::test
