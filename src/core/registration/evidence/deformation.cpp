#include "registration/evidence/deformation.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace usct::registration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Coefficients: of the constant, of x, y, z, of their squares, and of yz, xz, xy.
using Quadratic = Eigen::Matrix<double, 10, 1>;

Quadratic terms_at(const Vector3d& p) {
  Quadratic terms;
  terms << 1.0, p, p.cwiseAbs2(), p.y() * p.z(), p.x() * p.z(), p.x() * p.y();
  return terms;
}

Matrix3d curvature_of(const Quadratic& q) {
  Matrix3d curvature;
  curvature << 2.0 * q[4], q[9], q[8],  //
      q[9], 2.0 * q[5], q[7],           //
      q[8], q[7], 2.0 * q[6];
  return curvature;
}

/// The motion of a place by a stretch of 1, mm.
Vector3d stretched_by(const Vector3d& place_mm, const TissueRegion& region) {
  const Vector3d& axis = region.sweep_axis_us;
  return (place_mm - region.centre_us_mm).dot(axis) * axis;
}

/// Maps a small shift and turn to the motion of a place at this distance from the centre.
Eigen::Matrix<double, 3, 6> rigid_effect(const Vector3d& offset_mm) {
  Eigen::Matrix<double, 3, 6> effect;
  effect.leftCols<3>().setIdentity();
  for (int i = 0; i < 3; ++i) effect.col(3 + i) = Vector3d::Unit(i).cross(offset_mm);
  return effect;
}

/// The least of the solutions. Its matrices have sizes that the compiler does not know: a
/// decomposition for each fixed size took most of a minute to compile.
Eigen::VectorXd least_solution(const Eigen::MatrixXd& normal, const Eigen::VectorXd& right) {
  return normal.completeOrthogonalDecomposition().solve(right);
}

/// The parameters that explain most of the motions, where `effect` maps them to that of a place.
/// Few wishes do not determine all parameters; those of least size are then taken.
template <int kParameters, class Effect>
Eigen::Matrix<double, kParameters, 1> explained(const std::vector<Wish>& wishes,
                                                const Effect& effect) {
  Eigen::Matrix<double, kParameters, kParameters> normal;
  Eigen::Matrix<double, kParameters, 1> right;
  normal.setZero();
  right.setZero();
  for (const Wish& wish : wishes) {
    const Eigen::Matrix<double, 3, kParameters> of_place = effect(wish.place_mm);
    normal += wish.weight * of_place.transpose() * of_place;
    right += wish.weight * of_place.transpose() * wish.motion_mm;
  }
  return least_solution(normal, right);
}

/// The stretch across the frames that explains most of the motions, beside a rotation and a
/// translation, parts of which would else pass for it.
double stretch_of(const std::vector<Wish>& wishes, const TissueRegion& region) {
  const Eigen::Matrix<double, 7, 1> parameters =
      explained<7>(wishes, [&](const Vector3d& place_mm) {
        Eigen::Matrix<double, 3, 7> effect;
        effect << rigid_effect(place_mm - region.centre_us_mm), stretched_by(place_mm, region);
        return effect;
      });
  // Wishes in one layer across the frames, as in a short sweep, do not tell a stretch: noise may
  // pass for any.
  constexpr double kMost = 0.2;  // more than errors of motors and trackers are
  return std::clamp(parameters[6], -kMost, kMost);
}

/// The middle of the places by their weights, or nothing if there is none.
std::optional<Vector3d> middle_mm(const std::vector<Wish>& wishes) {
  Vector3d sum = Vector3d::Zero();
  double weights = 0.0;
  for (const Wish& wish : wishes) {
    sum += wish.weight * wish.place_mm;
    weights += wish.weight;
  }
  if (!(weights > 0.0)) return std::nullopt;
  return sum / weights;
}

}  // namespace

PeakFinder::PeakFinder(std::vector<Vector3d> moves_mm) : moves_mm_(std::move(moves_mm)) {
  Eigen::MatrixXd terms(moves_mm_.size(), Quadratic::RowsAtCompileTime);
  reach_mm_ = 0.0;
  for (std::size_t i = 0; i < moves_mm_.size(); ++i) {
    terms.row(static_cast<Eigen::Index>(i)) = terms_at(moves_mm_[i]);
    reach_mm_ = std::max(reach_mm_, moves_mm_[i].cwiseAbs().maxCoeff());
  }
  fit_ = terms.completeOrthogonalDecomposition().pseudoInverse();
}

Vector3d PeakFinder::peak_mm(const std::vector<double>& values) const {
  constexpr double kReaches = 1.5;
  const auto size = static_cast<Eigen::Index>(values.size());
  const Quadratic fitted = fit_ * Eigen::Map<const Eigen::VectorXd>(values.data(), size);
  const Eigen::LLT<Matrix3d> downwards(-curvature_of(fitted));
  if (downwards.info() == Eigen::Success) {
    const Vector3d peak = downwards.solve(fitted.segment<3>(1));
    if (peak.cwiseAbs().maxCoeff() <= kReaches * reach_mm_) return peak;
  }
  const auto best = std::max_element(values.begin(), values.end());
  return moves_mm_[static_cast<std::size_t>(best - values.begin())];
}

Eigen::Isometry3d rigid_motion(const std::vector<Wish>& wishes) {
  const std::optional<Vector3d> middle = middle_mm(wishes);
  if (!middle) return Eigen::Isometry3d::Identity();
  const Eigen::Matrix<double, 6, 1> shift_and_turn = explained<6>(
      wishes, [&](const Vector3d& place_mm) { return rigid_effect(place_mm - *middle); });
  const Vector3d turn_rad = shift_and_turn.tail<3>();
  return Eigen::Translation3d(*middle + shift_and_turn.head<3>()) *
         Eigen::AngleAxisd(turn_rad.norm(), turn_rad.stableNormalized()) *
         Eigen::Translation3d(-*middle);
}

double deformation_mm(const std::vector<Wish>& wishes, const TissueRegion& region) {
  const double stretch = stretch_of(wishes, region);
  double squares = 0.0;
  double weights = 0.0;
  for (const Wish& wish : wishes) {
    if ((wish.place_mm - region.centre_us_mm).norm() > region.radius_mm) continue;
    const Vector3d moved_mm = wish.motion_mm - stretch * stretched_by(wish.place_mm, region);
    squares += wish.weight * moved_mm.squaredNorm();
    weights += wish.weight;
  }
  return weights > 0.0 ? std::sqrt(squares / weights) : 0.0;
}

}  // namespace usct::registration
