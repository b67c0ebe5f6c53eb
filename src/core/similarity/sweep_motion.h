#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"

namespace usct {

/// Motion of the frames if the sweep is longer than recorded: the tangent of each beam's path,
/// times the distance of its frame from the middle of the sweep. A frame's position along the sweep
/// is the arc length of the path of the field's centre, smoothed since tracked poses jitter.
class SweepMotion {
 public:
  /// The beams must outlive it.
  explicit SweepMotion(const BeamGrid& beams);

  /// Motion of a beam's origin and direction per unit of error, mm.
  Beam operator()(int frame, int line) const;

 private:
  /// Weights, 1/mm, of the values at frames in their derivative by the path.
  using Tangent = std::vector<std::pair<int, double>>;

  double path_mm(int frame) const { return path_mm_[static_cast<std::size_t>(frame)]; }
  /// Mean over a window that shrinks towards the ends of the sweep and so stays centred on the
  /// frame.
  Eigen::Vector3d smoothed_centre(int frame) const;
  /// Tangent of the parabola through three frames around this one, or nearest to it at the ends of
  /// the sweep; of a straight line if there are fewer frames. Empty if nothing moves.
  Tangent tangent(int frame) const;

  const BeamGrid& beams_;
  int window_;  // number of frames on either side
  std::vector<double> path_mm_;
  std::vector<Tangent> tangents_;
};

}  // namespace usct
