#include <algorithm>
#include <cmath>

#include "similarity/joint_derivatives.h"

namespace usct {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

/// How the position of a sample between the knots, and a function of that, change.
class BetweenKnots {
 public:
  BetweenKnots(const JointSumsInput& in, double value, double gradient)
      : columns_(static_cast<std::size_t>(in.columns)) {
    const double scale = in.gradient_scale_hu_per_mm / in.samples.ct.step_hu();
    const double row = value * row_by_value(in);
    const double column = gradient / (gradient + scale) * (in.columns - 1);
    row_ = std::min(static_cast<int>(row), in.rows - 2);
    column_ = std::min(static_cast<int>(column), in.columns - 2);
    along_row_ = row - row_;
    along_column_ = column - column_;
    by_value_ = row_by_value(in);
    by_gradient_ = (in.columns - 1) * scale / ((gradient + scale) * (gradient + scale));
  }

  /// Derivatives of the bilinear interpolation of `at_knot(knot)` by CT value and gradient.
  template <typename AtKnot>
  Eigen::Vector2d slopes(const AtKnot& at_knot) const {
    const std::size_t first =
        static_cast<std::size_t>(row_) * columns_ + static_cast<std::size_t>(column_);
    const double a00 = at_knot(first), a01 = at_knot(first + 1);
    const double a10 = at_knot(first + columns_), a11 = at_knot(first + columns_ + 1);
    return {by_value_ * ((1.0 - along_column_) * (a10 - a00) + along_column_ * (a11 - a01)),
            by_gradient_ * ((1.0 - along_row_) * (a01 - a00) + along_row_ * (a11 - a10))};
  }

 private:
  static double row_by_value(const JointSumsInput& in) { return (in.rows - 1) / 255.0; }

  std::size_t columns_;
  int row_, column_;
  double along_row_, along_column_;
  double by_value_, by_gradient_;
};

}  // namespace

void add_joint_derivatives_scalar(const JointDerivativesInput& in, std::size_t block,
                                  const BlockSamples& samples, DerivativeOrder order,
                                  JointDerivatives& sums) {
  const UltrasoundPatches& us = in.sums.samples.us;
  const Eigen::Matrix3d to_us = in.sums.samples.T_index_us.linear().transpose();
  const double background = in.sums.samples.ct.background();
  for (std::size_t i = 0; i < us.blocks[block].rows * kLanes; ++i) {
    const std::size_t s = us.blocks[block].begin + i;
    const double u = static_cast<double>(in.sums.ultrasound[s]);
    if (std::isnan(u)) continue;
    const BlockSamples::Row& row = samples.rows[i / kLanes];
    const std::size_t lane = i % kLanes;
    Eigen::Matrix<double, 3, 2> slopes;  // of CT value and gradient, in the US frame
    for (int axis = 0; axis < 3; ++axis)
      slopes.row(axis) << static_cast<double>(row.by_m[axis][lane]),
          static_cast<double>(row.by_g[axis][lane]);
    slopes = (to_us * slopes).eval();
    const Eigen::Vector3d at_mm(us.x_mm[s], us.y_mm[s], us.z_mm[s]);
    const auto by_motion = [&](const Eigen::Vector3d& by_position) {
      Vector6 result;
      result << at_mm.cross(by_position), by_position;
      return result;
    };
    const BetweenKnots knots(in.sums, static_cast<double>(row.m[lane]) + background,
                             static_cast<double>(row.g[lane]));
    const auto function = [&](std::size_t knot) { return static_cast<double>(in.function[knot]); };
    const Vector6 value = by_motion(slopes * knots.slopes([&](std::size_t knot) {
      return function(knot) * (2.0 * u - function(knot));
    }));
    for (int p = 0; p < 6; ++p) sums.value[p] += value[p];
    if (order == DerivativeOrder::kGradient) continue;
    const Vector6 change = by_motion(slopes * knots.slopes(function));
    std::size_t at = 0;
    for (int p = 0; p < 6; ++p)
      for (int q = 0; q <= p; ++q) sums.function[at++] += change[p] * change[q];
  }
}

}  // namespace usct
