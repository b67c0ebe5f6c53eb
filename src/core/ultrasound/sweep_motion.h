#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "ultrasound/moving_place.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/ultrasound/acquisition_errors.h"

namespace usct {

/// Motion of the frames if the sweep is longer than recorded: the tangent of each beam's path,
/// times the distance of its frame from the middle of the sweep. A frame's position along the sweep
/// is the arc length of the path of a place that moves with the field (moving_place), smoothed
/// since tracked poses jitter.
class SweepMotion {
 public:
  /// The beams must outlive it.
  explicit SweepMotion(const BeamGrid& beams);

  /// Motion of a beam's origin and direction per unit of error, mm.
  Beam per_error(int frame, int line) const;
  /// The place of a beam if its frame is (1 + error) times as far from the middle of the sweep as
  /// recorded: between recorded frames, or beyond the last one along its tangent.
  Beam moved(int frame, int line, double error) const;
  /// 1 after the middle of the sweep, -1 before it.
  double side(int frame) const { return from_middle_mm(frame) < 0.0 ? -1.0 : 1.0; }

 private:
  /// Weights, 1/mm, of the values at frames in their derivative by the path.
  using Tangent = std::vector<std::pair<int, double>>;

  /// The change of a beam's origin and direction per mm of the path.
  Beam slope(int frame, int line) const;
  double path_mm(int frame) const { return path_mm_[static_cast<std::size_t>(frame)]; }
  double from_middle_mm(int frame) const { return path_mm(frame) - 0.5 * path_mm_.back(); }
  /// Mean over a window that shrinks towards the ends of the sweep and so stays centred on the
  /// frame.
  Eigen::Vector3d smoothed_place(int frame) const;
  /// Tangent of the parabola through three frames around this one, or nearest to it at the ends of
  /// the sweep; of a straight line if there are fewer frames. Empty if nothing moves.
  Tangent tangent(int frame) const;

  const BeamGrid& beams_;
  const MeasuredPlace place_;
  int window_;  // number of frames on either side
  std::vector<double> path_mm_;
  std::vector<Tangent> tangents_;
};

/// The beams with the errors of the sweep taken out: AcquisitionErrors::sweep and ::unevenness.
BeamGrid with_sweep(const BeamGrid& beams, const AcquisitionErrors& errors);

}  // namespace usct
