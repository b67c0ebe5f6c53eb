#include "us_ct_registration/evaluation/surface_standard.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "baselines/nearest_points.h"
#include "geometry/point_spread.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

double mean_square_mm2(const Points& from, const Isometry3d& T, const NearestPoints& to) {
  double sum = 0.0;
  for (const Vector3d& p : from) sum += to.nearest(T * p).square_distance_mm2;
  return sum / static_cast<double>(from.size());
}

/// Principal axes as columns of a rotation, the longest last.
Matrix3d axes_of(const PointSpread& spread) {
  Matrix3d axes = Eigen::SelfAdjointEigenSolver<Matrix3d>(spread.covariance_mm2).eigenvectors();
  if (axes.determinant() < 0.0) axes.col(0) *= -1.0;
  return axes;
}

PointSpread checked_spread(const Points& points_mm, const std::string& source) {
  constexpr std::size_t kLeastPoints = 10;
  constexpr double kLeastRatio = 0.05;
  if (points_mm.size() < kLeastPoints)
    throw InputError(source, std::to_string(points_mm.size()) + " points, must be at least " +
                                 std::to_string(kLeastPoints));
  require_spread(points_mm, kLeastRatio, source);
  return point_spread(points_mm);
}

/// The pose T_us_ct that brings the centroids and these axes together.
Isometry3d aligned(const PointSpread& us, const Matrix3d& axes_us, const PointSpread& ct,
                   const Matrix3d& axes_ct) {
  Isometry3d T = Isometry3d::Identity();
  T.linear() = axes_us * axes_ct.transpose();
  T.translation() = us.centroid_mm - T.linear() * ct.centroid_mm;
  return T;
}

double least_ratio(const Vector3d& deviations_mm) {
  return std::min(deviations_mm[1] / deviations_mm[0], deviations_mm[2] / deviations_mm[1]);
}

}  // namespace

double distinction_of(double best_mm, double second_mm) {
  constexpr double kExactMm = 0.1;
  return std::max(second_mm, kExactMm) / std::max(best_mm, kExactMm);
}

double SurfaceStandard::distinction() const {
  return distinction_of(alignments[0].distance_mm, alignments[1].distance_mm);
}

double SurfaceStandard::roundness_ratio() const {
  return std::min(least_ratio(deviations_us_mm), least_ratio(deviations_ct_mm));
}

SurfaceStandard surface_standard(const Points& surface_us_mm, const Points& surface_ct_mm,
                                 const std::string& us_name, const std::string& ct_name) {
  const PointSpread us = checked_spread(surface_us_mm, us_name);
  const PointSpread ct = checked_spread(surface_ct_mm, ct_name);
  const NearestPoints nearest_us(surface_us_mm);
  const NearestPoints nearest_ct(surface_ct_mm);
  const Matrix3d axes_us = axes_of(us);
  const Matrix3d axes_ct = axes_of(ct);
  SurfaceStandard standard;
  standard.deviations_us_mm = us.deviations_mm;
  standard.deviations_ct_mm = ct.deviations_mm;
  const Vector3d signs[] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  for (std::size_t i = 0; i < standard.alignments.size(); ++i) {
    const Isometry3d T = aligned(us, axes_us * signs[i].asDiagonal(), ct, axes_ct);
    const double square = 0.5 * (mean_square_mm2(surface_ct_mm, T, nearest_us) +
                                 mean_square_mm2(surface_us_mm, T.inverse(), nearest_ct));
    standard.alignments[i] = {T, std::sqrt(square)};
  }
  std::sort(standard.alignments.begin(), standard.alignments.end(),
            [](const SurfaceAlignment& a, const SurfaceAlignment& b) {
              return a.distance_mm < b.distance_mm;
            });
  return standard;
}

std::vector<Isometry3d> axis_alignments(const Points& surface_us_mm, const Points& surface_ct_mm,
                                        const std::string& us_name, const std::string& ct_name) {
  const PointSpread us = checked_spread(surface_us_mm, us_name);
  const PointSpread ct = checked_spread(surface_ct_mm, ct_name);
  const Matrix3d axes_us = axes_of(us);
  const Matrix3d axes_ct = axes_of(ct);
  std::vector<Isometry3d> alignments;
  std::array<int, 3> order{0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Matrix3d axes;
      for (int axis = 0; axis < 3; ++axis)
        axes.col(axis) = axes_us.col(order[static_cast<std::size_t>(axis)]) *
                         ((signs >> axis & 1) != 0 ? -1.0 : 1.0);
      if (axes.determinant() < 0.0) continue;
      alignments.push_back(aligned(us, axes, ct, axes_ct));
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return alignments;
}

}  // namespace usct
