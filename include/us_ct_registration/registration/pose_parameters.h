#pragma once

#include <Eigen/Geometry>
#include <vector>

namespace usct {

/// Six numbers that an optimizer may move: three of rotation, three of translation.
using PoseVector = Eigen::Matrix<double, 6, 1>;

/// Poses `T_us_ct` as six numbers about an initial pose, whose numbers are 0.
///
/// A pose is the initial one followed by a motion in the US frame about the centre c of the given
/// points (those of the field of view, or of the kidney):
/// `p_us = c + R(w) (T_us_ct_initial p_ct - c) + t`, with w = S r rad the rotation vector of R,
/// r the first three numbers, and t mm the last three.
///
/// S makes the numbers millimetres: with M the mean over the points of `[p - c]x^T [p - c]x`, mm^2,
/// a small rotation w moves them by `sqrt(w^T M w)` (root mean square), so S = M^(-1/2). Since the
/// points' centroid is the centre, the same holds for all six together: **a small step of length 1
/// in any direction moves the points by 1 mm (root mean square)**.
///
/// The rotation is a rotation vector, where the thesis has Euler angles: it needs no order of axes,
/// has no gimbal lock and the same precision in all directions, and a common rigid motion of both
/// poses only turns the numbers. Every pose has such numbers; they are unique for rotations below
/// 180 degrees.
class PoseParameters {
 public:
  /// `points_us_mm` lie in the US frame at the initial pose. Throws InputError if the pose is not
  /// rigid and finite, if a point is not finite, or if the points lie on a line (as fewer than
  /// three do), since rotation about that line would move none.
  PoseParameters(const Eigen::Isometry3d& T_us_ct_initial,
                 const std::vector<Eigen::Vector3d>& points_us_mm);

  /// The same numbers about another initial pose, which must be rigid and finite.
  PoseParameters about(const Eigen::Isometry3d& T_us_ct_initial) const;

  Eigen::Isometry3d T_us_ct(const PoseVector& parameters) const;
  /// The derivative of the motion by the parameters: a small change x of them moves the points of
  /// the CT in the US frame by the rotation vector (rad) and the translation (mm) `derivative * x`,
  /// the rotation about the origin of the US frame.
  Eigen::Matrix<double, 6, 6> motion_derivative(const PoseVector& parameters) const;
  /// The numbers of the motion with rotation vector w about the centre and translation t.
  PoseVector parameters_of_motion(const Eigen::Vector3d& rotation_vector_rad,
                                  const Eigen::Vector3d& translation_mm) const;

  const Eigen::Isometry3d& T_us_ct_initial() const { return T_us_ct_initial_; }
  const Eigen::Vector3d& centre_us_mm() const { return centre_us_mm_; }

 private:
  Eigen::Isometry3d T_us_ct_initial_;
  Eigen::Vector3d centre_us_mm_;
  Eigen::Matrix3d rotation_scale_;  // S, symmetric, rad/mm
  Eigen::Matrix3d inverse_rotation_scale_;
};

/// Mean distance between the points as two transforms map them, mm; for `T_us_ct` these are points
/// of the CT. Throws InputError if there is no point.
double mean_displacement_mm(const Eigen::Isometry3d& T_a, const Eigen::Isometry3d& T_b,
                            const std::vector<Eigen::Vector3d>& points_mm);

}  // namespace usct
