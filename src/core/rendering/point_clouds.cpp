#include "us_ct_registration/rendering/point_clouds.h"

#include <algorithm>
#include <cmath>

#include "ultrasound/decimation.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"
#include "us_ct_registration/volume/sampling.h"

namespace usct {
namespace {

void add_line(const BeamUltrasound& us, int frame, int line, int step,
              std::vector<CloudPoint>& points) {
  for (int sample = 0; sample < us.beams.samples(); sample += step)
    points.push_back(
        {us.beams.point(frame, line, sample), us.brightness[us.beams.offset(frame, line, sample)]});
}

}  // namespace

Eigen::Isometry3d T_us_acquired(const ScanGeometry& geometry) {
  const auto* tracked = std::get_if<TrackedSweep>(&geometry.motion);
  if (tracked == nullptr || tracked->T_us_frame.empty()) return Eigen::Isometry3d::Identity();
  return tracked->T_us_frame[tracked->T_us_frame.size() / 2];
}

Eigen::Isometry3d T_us_field(const ScanGeometry& geometry) {
  const BeamGrid beams = beam_grid(geometry);
  Eigen::Isometry3d T = T_us_acquired(geometry);
  T.translation() = beams.point(beams.frames / 2, beams.lines / 2, beams.samples() / 2);
  return T;
}

std::vector<CloudPoint> crossed_fans(const BeamUltrasound& us, double spacing_mm) {
  const BeamGrid& beams = us.beams;
  const int step = std::max(1, static_cast<int>(std::ceil(spacing_mm / beams.axial.spacing_mm)));
  std::vector<CloudPoint> points;
  for (int line = 0; line < beams.lines; ++line) add_line(us, beams.frames / 2, line, step, points);
  for (int frame = 0; frame < beams.frames; ++frame)
    if (frame != beams.frames / 2) add_line(us, frame, beams.lines / 2, step, points);
  return points;
}

std::vector<CloudPoint> whole_volume(const BeamUltrasound& recorded, double spacing_mm) {
  const BeamUltrasound us = decimate(recorded, factors_for_spacing(recorded.beams, spacing_mm));
  std::vector<CloudPoint> points;
  points.reserve(us.brightness.size());
  for (int frame = 0; frame < us.beams.frames; ++frame)
    for (int line = 0; line < us.beams.lines; ++line)
      for (int sample = 0; sample < us.beams.samples(); ++sample)
        points.push_back({us.beams.point(frame, line, sample), us.brightness[points.size()]});
  return points;
}

std::vector<CloudPoint> ct_at(const std::vector<CloudPoint>& points, const CtVolume& ct,
                              const Eigen::Isometry3d& T_ct_points) {
  std::vector<CloudPoint> result;
  for (const CloudPoint& point : points) {
    const Eigen::Vector3d index = ct.grid.index_from_physical(T_ct_points * point.p_mm);
    if (!contains_index(ct.grid, index)) continue;
    result.push_back(
        {point.p_mm, sample_at_index(ct, index, Interpolation::kTrilinear, Outside::edge())});
  }
  return result;
}

}  // namespace usct
