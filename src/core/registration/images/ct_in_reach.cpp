#include "registration/images/ct_in_reach.h"

#include <algorithm>

namespace usct::registration {
namespace {

using Eigen::Vector3d;

/// First and last samples of lines that are spread over each frame: a probe may go there and back
/// any number of times, so that no choice of frames is sure to have all places.
std::vector<Vector3d> outline(const BeamGrid& beams) {
  constexpr int kSteps = 6;
  std::vector<Vector3d> points;
  for (int f = 0; f < beams.frames; ++f)
    for (int l = 0; l <= kSteps; ++l)
      for (const int s : {0, beams.samples() - 1})
        points.push_back(beams.point(f, l * (beams.lines - 1) / kSteps, s));
  return points;
}

}  // namespace

CtInReach ct_in_reach(const CtVolume& ct, const BeamGrid& beams,
                      const Eigen::Isometry3d& T_us_ct_initial, const SearchOptions& options) {
  std::vector<Vector3d> points = outline(beams);
  double margin_mm = options.ct_margin_mm;
  if (const std::optional<StartOptions>& starts = options.starts) {
    Vector3d centre = Vector3d::Zero();
    for (const Vector3d& p : points) centre += p / static_cast<double>(points.size());
    double radius_mm = 0.0;
    for (const Vector3d& p : points) radius_mm = std::max(radius_mm, (p - centre).norm());
    margin_mm += starts->translation_mm +
                 radius_mm * std::min(options.ct_most_turn_rad, starts->rotation_rad);
  }
  for (Vector3d& p : points) p = T_us_ct_initial.inverse() * p;
  return {ct, region_around(ct.grid, points, margin_mm)};
}

CtInReach ct_around(const CtVolume& ct, const PreparedUltrasound& prepared,
                    const Eigen::Isometry3d& T_us_ct, double margin_mm) {
  std::vector<Vector3d> points = prepared.field.us_mm();
  for (Vector3d& p : points) p = T_us_ct.inverse() * p;
  return {ct, region_around(ct.grid, points, margin_mm)};
}

}  // namespace usct::registration
