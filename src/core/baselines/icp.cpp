#include "us_ct_registration/baselines/icp.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>

#include "baselines/motion.h"
#include "baselines/nearest_points.h"
#include "geometry/point_spread.h"
#include "require.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/formatted.h"

namespace usct {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Points = std::vector<Vector3d>;

constexpr std::size_t kLeastSurfacePoints = 20;
// Neighbours that give a normal: enough to average noise, within a small part of a kidney.
constexpr std::size_t kNeighbours = 16;
// Below this information a kidney of a few hundred points with errors of 1 mm slides by several mm.
constexpr double kLeastInformation = 1e-3;
// Damping, in the unit of information: it slows steps along motions that are hardly determined, and
// does not move the solution.
constexpr double kDamping = 1e-4;

struct Normals {
  Points normals;
  /// Mean square error of a normal's direction across one axis, rad^2.
  double variance = 0.0;
};

Normals estimate_normals(const Points& surface_mm, const NearestPoints& nearest) {
  Normals result;
  for (const Vector3d& p : surface_mm) {
    Vector3d mean = Vector3d::Zero();
    Matrix3d squares = Matrix3d::Zero();
    const std::vector<unsigned> neighbours = nearest.nearest(p, kNeighbours);
    const auto count = static_cast<double>(neighbours.size());
    for (const unsigned i : neighbours) mean += surface_mm[i] / count;
    for (const unsigned i : neighbours) {
      const Vector3d offset = surface_mm[i] - mean;
      squares += offset * offset.transpose() / count;
    }
    const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(squares);
    result.normals.push_back(solver.eigenvectors().col(0));
    // A line through heights of this variance over a base of that variance has this slope's error.
    const double base = std::max(solver.eigenvalues()[1], 1e-12);
    result.variance += std::max(solver.eigenvalues()[0], 0.0) / (base * count) /
                       static_cast<double>(surface_mm.size());
  }
  return result;
}

/// A point of the ultrasound, its nearest point of the CT and that point's normal, in CT mm.
struct Pair {
  Vector3d us_mm;
  Vector3d ct_mm;
  Vector3d normal;
  double square_mm2;

  double plane_distance_mm() const { return normal.dot(ct_mm - us_mm); }
};

/// The pairs of one iteration and the linear equations that they give for a motion of the
/// ultrasound's points about their centre, with turns in units of 1 / `lever_mm`.
struct Equations {
  explicit Equations(const std::vector<Pair>& pairs) {
    const auto count = static_cast<double>(pairs.size());
    for (const Pair& pair : pairs) centre_mm += pair.us_mm / count;
    double squares = 0.0;
    for (const Pair& pair : pairs) squares += (pair.us_mm - centre_mm).squaredNorm() / count;
    lever_mm = std::sqrt(squares);
    for (const Pair& pair : pairs) {
      const Vector6d row = row_of(pair);
      information += row * row.transpose() / count;
      right += row * pair.plane_distance_mm() / count;
      distance_mm += pair.square_mm2 / count;
      plane_distance_mm += std::pow(pair.plane_distance_mm(), 2.0) / count;
    }
    distance_mm = std::sqrt(distance_mm);
    plane_distance_mm = std::sqrt(plane_distance_mm);
  }

  Vector6d row_of(const Pair& pair) const {
    Vector6d row;
    row << pair.normal, (pair.us_mm - centre_mm).cross(pair.normal) / lever_mm;
    return row;
  }

  /// The motion that brings the points closest to the planes, limited to what the linear equations
  /// hold for.
  Vector6d step() const {
    constexpr double kLargestTurnRad = 0.3;
    Vector6d step = (information + kDamping * Matrix6d::Identity()).ldlt().solve(right);
    const double turn_rad = step.tail<3>().norm() / lever_mm;
    if (turn_rad > kLargestTurnRad) step *= kLargestTurnRad / turn_rad;
    return step;
  }

  Isometry3d motion(const Vector6d& step) const {
    return motion_about(centre_mm, step.head<3>(), step.tail<3>() / lever_mm);
  }

  Vector3d centre_mm = Vector3d::Zero();
  double lever_mm = 0.0;
  Matrix6d information = Matrix6d::Zero();
  Vector6d right = Vector6d::Zero();
  double distance_mm = 0.0;
  double plane_distance_mm = 0.0;
};

std::vector<Pair> pairs_of(const Points& us_mm, const Isometry3d& T_ct_us, const Points& ct_mm,
                           const NearestPoints& nearest, const Points& normals,
                           const IcpOptions& options) {
  const double largest = options.largest_distance_mm * options.largest_distance_mm;
  std::vector<Pair> pairs;
  for (const Vector3d& p_us : us_mm) {
    const Vector3d p = T_ct_us * p_us;
    const NearestPoints::Nearest found = nearest.nearest(p);
    if (found.square_distance_mm2 <= largest)
      pairs.push_back({p, ct_mm[found.index], normals[found.index], found.square_distance_mm2});
  }
  const auto kept = static_cast<std::size_t>(
      std::ceil(options.overlap * static_cast<double>(us_mm.size()) - 1e-9));
  if (pairs.size() > kept) {
    std::nth_element(pairs.begin(), pairs.begin() + static_cast<std::ptrdiff_t>(kept), pairs.end(),
                     [](const Pair& a, const Pair& b) { return a.square_mm2 < b.square_mm2; });
    pairs.resize(kept);
  }
  if (pairs.size() < kLeastSurfacePoints)
    throw InputError(
        "surfaces",
        formatted("%zu points of the ultrasound are within %g mm of the CT's surface, "
                  "must be at least %zu: the surfaces do not overlap (the start may be far off or "
                  "inverted, or the files of ultrasound and CT exchanged)",
                  pairs.size(), options.largest_distance_mm, kLeastSurfacePoints));
  return pairs;
}

double capped_distance_mm(const Points& us_mm, const Isometry3d& T_ct_us,
                          const NearestPoints& nearest, double largest_mm) {
  double squares = 0.0;
  for (const Vector3d& p_us : us_mm)
    squares +=
        std::min(nearest.nearest(T_ct_us * p_us).square_distance_mm2, largest_mm * largest_mm);
  return std::sqrt(squares / static_cast<double>(us_mm.size()));
}

void judge(const Equations& equations, const std::vector<Pair>& pairs, double normal_variance,
           IcpResult& result) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(equations.information);
  result.pairs = static_cast<int>(pairs.size());
  result.distance_mm = equations.distance_mm;
  result.plane_distance_mm = equations.plane_distance_mm;
  result.least_information = std::max(solver.eigenvalues()[0], 0.0);
  result.information_floor = normal_variance;
  const Matrix3d R_us_ct = result.T_us_ct.linear();
  const Vector6d least = solver.eigenvectors().col(0);
  result.least_determined = {R_us_ct * least.head<3>(),
                             R_us_ct * least.tail<3>() / equations.lever_mm};
  result.centre_us_mm = result.T_us_ct * equations.centre_mm;

  // Six of the pairs' degrees of freedom go into the motion. The displacement of p is M x for a
  // motion x with covariance C; its expected square is the trace of M C M'.
  const auto count = static_cast<double>(pairs.size());
  const double variance =
      equations.plane_distance_mm * equations.plane_distance_mm * count / (count - 6.0);
  const Vector6d inverse = solver.eigenvalues().cwiseMax(1e-12).cwiseInverse();
  const Matrix6d covariance = variance / count * solver.eigenvectors() * inverse.asDiagonal() *
                              solver.eigenvectors().transpose();
  double squares = 0.0;
  for (const Pair& pair : pairs) {
    Eigen::Matrix<double, 3, 6> moved;
    const Vector3d arm = (pair.us_mm - equations.centre_mm) / equations.lever_mm;
    moved.leftCols<3>().setIdentity();
    for (int axis = 0; axis < 3; ++axis) moved.col(3 + axis) = Vector3d::Unit(axis).cross(arm);
    squares += (moved * covariance * moved.transpose()).trace() / count;
  }
  result.predicted_error_mm = std::sqrt(squares);
}

void require_surface(const Points& points_mm, const std::string& source) {
  if (points_mm.size() < kLeastSurfacePoints)
    throw InputError(source, std::to_string(points_mm.size()) + " points, must be at least " +
                                 std::to_string(kLeastSurfacePoints));
  require_spread(points_mm, 0.05, source);
}

}  // namespace

void IcpOptions::validate() const {
  const std::string source = "ICP options";
  require(overlap > 0.0 && overlap <= 1.0, source, "overlap", overlap, "above 0 and at most 1");
  require_positive(source, "largest_distance_mm", largest_distance_mm);
  require_positive(source, "tolerance_mm", tolerance_mm);
  require(largest_iterations >= 1, source, "largest_iterations", largest_iterations, "at least 1");
}

bool IcpResult::undetermined() const {
  return least_information < kLeastInformation + 2.0 * information_floor;
}

IcpResult icp(const Points& surface_us_mm, const Points& surface_ct_mm,
              const Isometry3d& start_T_us_ct, const IcpOptions& options,
              const std::string& us_name, const std::string& ct_name) {
  options.validate();
  require_surface(surface_us_mm, us_name);
  require_surface(surface_ct_mm, ct_name);
  const NearestPoints nearest(surface_ct_mm);
  const Normals ct = estimate_normals(surface_ct_mm, nearest);
  IcpResult result;
  Isometry3d T_ct_us = start_T_us_ct.inverse();
  while (true) {
    const std::vector<Pair> pairs =
        pairs_of(surface_us_mm, T_ct_us, surface_ct_mm, nearest, ct.normals, options);
    const Equations equations(pairs);
    if (result.converged || result.iterations == options.largest_iterations) {
      result.T_us_ct = T_ct_us.inverse();
      judge(equations, pairs, ct.variance, result);
      result.capped_distance_mm =
          capped_distance_mm(surface_us_mm, T_ct_us, nearest, options.largest_distance_mm);
      return result;
    }
    const Vector6d step = equations.step();
    T_ct_us = equations.motion(step) * T_ct_us;
    ++result.iterations;
    // Since turns are in units of 1 / lever, the norm is the motion of a point at the lever.
    result.converged = step.norm() < options.tolerance_mm;
  }
}

}  // namespace usct
