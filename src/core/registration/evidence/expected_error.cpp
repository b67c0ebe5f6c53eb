#include "registration/evidence/expected_error.h"

#include <algorithm>
#include <cmath>

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
  const Eigen::AngleAxisd turn(T.rotation());
  const Vector3d rotation = turn.angle() * turn.axis();
  Motion motion;
  motion << rotation, T * centre_us_mm - centre_us_mm - rotation.cross(centre_us_mm);
  return motion;
}

Motion shift(const Vector3d& by_mm) {
  Motion motion;
  motion << Vector3d::Zero(), by_mm;
  return motion;
}

Vector3d middle_of_frame(const BeamGrid& beams, int frame) {
  return beams.point(frame, beams.lines / 2, 0.5 * (beams.samples() - 1));
}

double depth_of(const Vector3d& point_us_mm, const BeamGrid& beams, const Vector3d& axial) {
  Vector3d origin = Vector3d::Zero();
  for (const Beam& beam : beams.beams)
    origin += beam.origin_mm / static_cast<double>(beams.beams.size());
  return (point_us_mm - origin).dot(axial);
}

}  // namespace

Eigen::Matrix<double, 6, 6> pose_covariance(const std::vector<HalfPoses>& halves,
                                            const BeamGrid& recorded, const Vector3d& centre_us_mm,
                                            const ErrorOptions& options,
                                            const AcquisitionErrors& shown) {
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
  const double depth_share = std::max(options.sound_speed_share, std::abs(shown.depth));
  add(shift(depth_share * depth_of(centre_us_mm, recorded, axial) * axial));
  const Vector3d path =
      middle_of_frame(recorded, recorded.frames - 1) - middle_of_frame(recorded, 0);
  const double sweep_share =
      recorded.corrected_sweep ? std::max(options.sweep_share, std::abs(shown.sweep)) : shown.sweep;
  add(shift(0.25 * sweep_share * path));
  if (recorded.tracked && recorded.frames > 1)
    add(shift(options.lag_frames / (recorded.frames - 1) * path));
  return covariance + shift_covariance(options.other_mm);
}

Eigen::Matrix<double, 6, 6> shift_covariance(double rms_mm) {
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  covariance.diagonal().tail<3>().setConstant(rms_mm * rms_mm / 3.0);
  return covariance;
}

}  // namespace usct::registration
