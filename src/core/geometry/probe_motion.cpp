#include "us_ct_registration/geometry/probe_motion.h"

#include <algorithm>
#include <utility>

#include "require.h"

namespace usct {
namespace {

void require_one_per_frame(int frames, const std::vector<Eigen::Isometry3d>& T_us_then) {
  require(T_us_then.size() == static_cast<std::size_t>(frames), "motion of the probe", "poses",
          static_cast<double>(T_us_then.size()), "one per frame");
}

}  // namespace

double probe_motion_mm(const BeamGrid& grid, const std::vector<Eigen::Isometry3d>& T_us_then) {
  require_one_per_frame(grid.frames, T_us_then);
  double longest_mm = 0.0;
  for (int frame = 0; frame < grid.frames; ++frame)
    for (int line = 0; line < grid.lines; ++line)
      // The way is a convex function of the position, so that one end of the beam moves most.
      for (const int sample : {0, grid.samples() - 1}) {
        const Eigen::Vector3d p = grid.point(frame, line, sample);
        const auto& T = T_us_then[static_cast<std::size_t>(frame)];
        longest_mm = std::max(longest_mm, (T * p - p).norm());
      }
  return longest_mm;
}

void follow_probe(const std::vector<Eigen::Isometry3d>& T_us_then, BeamGrid& grid) {
  require_one_per_frame(grid.frames, T_us_then);
  for (std::size_t i = 0; i < grid.beams.size(); ++i) {
    const Eigen::Isometry3d& T = T_us_then[i / static_cast<std::size_t>(grid.lines)];
    grid.beams[i].origin_mm = T * grid.beams[i].origin_mm;
    grid.beams[i].direction = T.linear() * grid.beams[i].direction;
  }
}

ScanGeometry follow_probe(const std::vector<Eigen::Isometry3d>& T_us_then, ScanGeometry geometry) {
  require_one_per_frame(geometry.frames(), T_us_then);
  TrackedSweep tracked;
  if (const auto* sweep = std::get_if<TrackedSweep>(&geometry.motion))
    tracked.frame_times_s = sweep->frame_times_s;
  for (int frame = 0; frame < geometry.frames(); ++frame)
    tracked.T_us_frame.push_back(T_us_then[static_cast<std::size_t>(frame)] *
                                 T_us_frame_of(geometry, frame, 0.5 * (geometry.lines() - 1)));
  geometry.motion = std::move(tracked);
  return geometry;
}

}  // namespace usct
