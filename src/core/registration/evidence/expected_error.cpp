#include "registration/evidence/expected_error.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "ultrasound/moving_place.h"
#include "ultrasound/resting_frames.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct::registration {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Motion = Eigen::Matrix<double, 6, 1>;

/// The motion of the US frame that leads from one pose to another: its rotation vector, and the
/// shift of the origin with which the point at `centre_us_mm` moves as it does. The translation
/// itself would count what a rotation that is not small does to an origin that is far away, as that
/// of a tracker is.
Motion motion_between(const Isometry3d& T_a_us_ct, const Isometry3d& T_b_us_ct,
                      const Vector3d& centre_us_mm) {
  const Isometry3d T = T_b_us_ct * T_a_us_ct.inverse();
  const Vector3d rotation = rotation_vector_of(T.rotation());
  Motion motion;
  motion << rotation, T * centre_us_mm - centre_us_mm - rotation.cross(centre_us_mm);
  return motion;
}

Motion shift(const Vector3d& by_mm) {
  Motion motion;
  motion << Vector3d::Zero(), by_mm;
  return motion;
}

bool has_samples_that_count(const BeamUltrasound& us, int frame) {
  const auto per_frame = static_cast<std::ptrdiff_t>(us.beams.lines) * us.beams.samples();
  const auto first = us.known.begin() + frame * per_frame;
  return std::any_of(first, first + per_frame, [](std::uint8_t known) { return known != 0; });
}

/// The frame of `grid` whose first and last lines lie nearest to those of a frame of another grid.
int nearest_frame(const BeamGrid& grid, const BeamGrid& other, int frame) {
  const auto ends = [](const BeamGrid& beams, int f) {
    const double middle = 0.5 * (beams.samples() - 1);
    return std::make_pair(beams.point(f, 0, middle), beams.point(f, beams.lines - 1, middle));
  };
  const auto [first, last] = ends(other, frame);
  int nearest = 0;
  double least_mm = std::numeric_limits<double>::infinity();
  for (int f = 0; f < grid.frames; ++f) {
    const auto [a, b] = ends(grid, f);
    const double mm = (a - first).norm() + (b - last).norm();
    if (mm < least_mm) nearest = f;
    least_mm = std::min(least_mm, mm);
  }
  return nearest;
}

double depth_of(const Vector3d& point_us_mm, const BeamGrid& beams, const Vector3d& axial) {
  Vector3d origin = Vector3d::Zero();
  for (const Beam& beam : beams.beams)
    origin += beam.origin_mm / static_cast<double>(beams.beams.size());
  return (point_us_mm - origin).dot(axial);
}

}  // namespace

BeamGrid frames_that_count(const BeamGrid& recorded, const BeamUltrasound& conditioned) {
  if (!recorded.tracked) return recorded;
  const int frames = conditioned.beams.frames;
  int first = 0;
  int last = frames - 1;
  while (first < last && !has_samples_that_count(conditioned, first)) ++first;
  while (last > first && !has_samples_that_count(conditioned, last)) --last;
  const int begin = first == 0 ? 0 : nearest_frame(recorded, conditioned.beams, first);
  const int end =
      last == frames - 1 ? recorded.frames : nearest_frame(recorded, conditioned.beams, last) + 1;
  if (begin >= end) return recorded;  // the probe came back
  BeamGrid counting = recorded;
  counting.frames = end - begin;
  const auto beam = [&](int frame) {
    return recorded.beams.begin() + static_cast<std::ptrdiff_t>(frame) * recorded.lines;
  };
  counting.beams.assign(beam(begin), beam(end));
  return counting;
}

Eigen::Matrix<double, 6, 6> pose_covariance(const std::vector<HalfPoses>& halves,
                                            const BeamGrid& recorded, const Vector3d& centre_us_mm,
                                            const ErrorOptions& options,
                                            const AcquisitionErrors& estimated) {
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  const auto add = [&](const Motion& deviation) {
    covariance += deviation * deviation.transpose();
  };
  // Both ways to halve the field estimate the same covariance, so their mean counts.
  const double share = options.parts_factor / 2.0 / std::sqrt(2.0 * halves.size());
  for (const HalfPoses& half : halves) {
    add(share * motion_between(half.left, half.right, centre_us_mm));
    add(share * motion_between(half.first, half.last, centre_us_mm));
  }
  const Vector3d axial = field_axes(recorded).axial;
  const double depth_share = std::max(options.sound_speed_share, std::abs(estimated.depth));
  add(shift(depth_share * depth_of(centre_us_mm, recorded, axial) * axial));
  const auto [line, sample] = moving_place(recorded);
  const Vector3d path =
      recorded.point(recorded.frames - 1, line, sample) - recorded.point(0, line, sample);
  const double sweep_share = recorded.corrected_sweep
                                 ? std::max(options.sweep_share, std::abs(estimated.sweep))
                                 : estimated.sweep;
  add(shift(0.25 * sweep_share * path));
  // Frames at rest are no part of the path.
  const int frames = moving_frames(recorded);
  if (recorded.tracked && frames > 1) add(shift(options.lag_frames / (frames - 1) * path));
  return covariance + shift_covariance(options.other_mm);
}

Eigen::Matrix<double, 6, 6> shift_covariance(double rms_mm) {
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  covariance.diagonal().tail<3>().setConstant(rms_mm * rms_mm / 3.0);
  return covariance;
}

}  // namespace usct::registration
