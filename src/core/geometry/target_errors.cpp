#include "us_ct_registration/geometry/target_errors.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>

#include "order_statistics.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/geometry/rigid.h"

namespace usct {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

void require_points(const std::vector<Eigen::Vector3d>& points_mm,
                    const std::string& source = "targets") {
  if (points_mm.empty()) throw InputError(source, "there are 0, must be at least 1");
  for (std::size_t i = 0; i < points_mm.size(); ++i)
    if (!points_mm[i].allFinite())
      throw InputError(source, "point " + std::to_string(i) + " is not finite");
}

void require_pose(const Eigen::Isometry3d& T, const std::string& name) {
  if (!T.matrix().allFinite()) throw InputError(name, "must be finite");
}

double root_mean_square(const std::vector<double>& squares) {
  double sum = 0.0;
  for (const double square : squares) sum += square;
  return std::sqrt(sum / static_cast<double>(squares.size()));
}

}  // namespace

void require_covariance(const Matrix6d& covariance, const std::string& source) {
  constexpr double kTolerance = 1e-6;
  const auto fail = [&](const char* violation) {
    throw InputError(source, std::string("'covariance' ") + violation);
  };
  if (!covariance.allFinite()) fail("must be finite");
  if ((covariance.diagonal().array() < 0.0).any())
    fail("has a negative variance, must be positive semidefinite");
  // The covariance is scaled to a unit diagonal, since rad^2 and mm^2 cannot be compared.
  const Eigen::Matrix<double, 6, 1> scale = covariance.diagonal().unaryExpr(
      [](double variance) { return variance > 0.0 ? 1.0 / std::sqrt(variance) : 1.0; });
  const Matrix6d correlation = scale.asDiagonal() * covariance * scale.asDiagonal();
  if (!((correlation - correlation.transpose()).cwiseAbs().maxCoeff() <= kTolerance))
    fail("must be symmetric");
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(correlation, Eigen::EigenvaluesOnly);
  if (!(solver.eigenvalues().minCoeff() >= -kTolerance)) fail("must be positive semidefinite");
}

TargetErrors evaluate_matched_targets(const Eigen::Isometry3d& T_us_ct,
                                      const std::vector<Eigen::Vector3d>& points_ct_mm,
                                      const std::vector<Eigen::Vector3d>& points_us_mm) {
  require_points(points_us_mm);
  require_points(points_ct_mm, "targets in the CT");
  require_pose(T_us_ct, "T_us_ct");
  if (points_ct_mm.size() != points_us_mm.size())
    throw InputError("targets in the CT", "there are " + std::to_string(points_ct_mm.size()) +
                                              ", must be as many as targets, " +
                                              std::to_string(points_us_mm.size()));
  TargetErrors errors;
  std::vector<double> squares;
  for (std::size_t i = 0; i < points_us_mm.size(); ++i) {
    const double error_mm = (T_us_ct * points_ct_mm[i] - points_us_mm[i]).norm();
    errors.per_target_mm.push_back(error_mm);
    squares.push_back(error_mm * error_mm);
    errors.mean_mm += error_mm / static_cast<double>(points_us_mm.size());
    errors.max_mm = std::max(errors.max_mm, error_mm);
  }
  errors.rms_mm = root_mean_square(squares);
  errors.median_mm = median(errors.per_target_mm);
  return errors;
}

std::vector<Eigen::Vector3d> ct_points_mm(const Eigen::Isometry3d& T_us_ct,
                                          const std::vector<Eigen::Vector3d>& points_us_mm) {
  const Eigen::Isometry3d T_ct_us = T_us_ct.inverse();
  std::vector<Eigen::Vector3d> points_ct_mm;
  points_ct_mm.reserve(points_us_mm.size());
  for (const Eigen::Vector3d& p_us : points_us_mm) points_ct_mm.push_back(T_ct_us * p_us);
  return points_ct_mm;
}

TargetErrors evaluate_targets(const Eigen::Isometry3d& T_us_ct,
                              const Eigen::Isometry3d& T_us_ct_true,
                              const std::vector<Eigen::Vector3d>& points_us_mm) {
  require_points(points_us_mm);
  require_pose(T_us_ct_true, "T_us_ct_true");
  return evaluate_matched_targets(T_us_ct, ct_points_mm(T_us_ct_true, points_us_mm), points_us_mm);
}

ExpectedTargetErrors expected_tre_mm(const Matrix6d& covariance,
                                     const std::vector<Eigen::Vector3d>& points_us_mm,
                                     const std::string& source) {
  require_points(points_us_mm);
  require_covariance(covariance, source);
  std::vector<double> squares;
  for (const Eigen::Vector3d& p_us : points_us_mm) {
    Eigen::Matrix<double, 3, 6> J;
    J << -cross_matrix(p_us), Eigen::Matrix3d::Identity();
    // Rounding may make the trace of a singular covariance slightly negative.
    squares.push_back(std::max(0.0, (J * covariance * J.transpose()).trace()));
  }
  return {root_mean_square(squares), std::sqrt(*std::max_element(squares.begin(), squares.end()))};
}

}  // namespace usct
