#include "registration/confidence.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "parallel.h"
#include "us_ct_registration/geometry/target_errors.h"

namespace usct::registration {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Poses this close to the best one may profit from it, mm.
constexpr double kAwayMm = 10.0;
/// A quadratic is fitted to what a similarity's parts are this far around a pose, mm: beyond the
/// grain of the sampling, within the peak. Where only some of the parts have their peak near by,
/// that is too far for the others.
constexpr double kAroundMm = 3.0;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.3g", value);
  return text;
}

/// 54 unit vectors, spread so evenly (the shortest ones of the lattice E6*, a spherical design of
/// strength 5) that what is fitted to values there does not depend on how the axes are turned.
std::vector<PoseVector> even_directions() {
  const double third = 1.0 / std::sqrt(3.0);
  std::vector<PoseVector> half{2.0 * third * PoseVector::Unit(5)};
  for (int axis = 0; axis < 5; ++axis)
    for (const double sign : {1.0, -1.0})
      half.emplace_back(sign * PoseVector::Unit(axis) - third * PoseVector::Unit(5));
  for (int signs = 0; signs < 32; ++signs) {
    PoseVector corner = PoseVector::Constant(0.5);
    corner[5] *= third;
    for (int axis = 0; axis < 5; ++axis)
      if ((signs >> axis & 1) != 0) corner[axis] = -0.5;
    if (corner.prod() > 0.0) half.push_back(corner);
  }
  std::vector<PoseVector> all;
  for (const PoseVector& direction : half)
    for (const double sign : {1.0, -1.0}) all.push_back(sign * direction.normalized());
  return all;
}

/// The quadratic that fits a similarity around a pose best.
struct Quadratic {
  Eigen::MatrixXd gradients;  // of the parts; columns: parameters
  Matrix6d hessian;           // of their sum
};

/// `centre`: the parts at the pose itself.
Quadratic quadratic_around(const Similarity& similarity, const Candidate& best,
                           const PoseParameters& pose, const std::vector<double>& centre,
                           const Search& search) {
  std::vector<PoseVector> places = even_directions();
  for (PoseVector& place : places) place *= kAroundMm;
  std::vector<std::vector<double>> parts(places.size());
  parallel_for(static_cast<int>(places.size()), [&](int i) {
    search.check_cancelled();
    const auto at = static_cast<std::size_t>(i);
    parts[at] = similarity.parts(pose.T_us_ct(places[at]).inverse(), best.errors);
  });

  constexpr double kAxes = 6.0;
  constexpr double kSquare = kAroundMm * kAroundMm;
  const auto count = static_cast<double>(places.size());
  const auto rows = static_cast<Eigen::Index>(centre.size());
  Quadratic fit{Eigen::MatrixXd::Zero(rows, 6), Matrix6d::Zero()};
  double mean = 0.0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Eigen::Map<const Eigen::VectorXd> values(parts[i].data(), rows);
    fit.gradients += kAxes / (count * kSquare) * values * places[i].transpose();
    fit.hessian += values.sum() / count * places[i] * places[i].transpose();
    mean += values.sum() / count;
  }
  // The mean of f x x^T, without its trace, is that of the Hessian times r^4 / (n (n + 2)); the
  // trace of the Hessian is in how far the mean of f lies below the centre.
  fit.hessian.diagonal().array() -= mean * kSquare / kAxes;
  fit.hessian *= kAxes * (kAxes + 2.0) / (kSquare * kSquare);
  const double at_centre = std::accumulate(centre.begin(), centre.end(), 0.0);
  fit.hessian.diagonal().array() += 2.0 * (mean - at_centre) / kSquare;
  return fit;
}

/// What small parameters do: d(w, t) / d(parameters), about the origin of the US frame.
Matrix6d motion_of_parameters(const PoseParameters& pose) {
  Matrix6d motion = Matrix6d::Zero();
  motion.topLeftCorner<3, 3>() = pose.rotation_scale();
  motion.bottomRightCorner<3, 3>().setIdentity();
  // p + w x (p - c) + t = p + w x p + (t + c x w).
  const Eigen::Vector3d& c = pose.centre_us_mm();
  Eigen::Matrix3d cross;
  cross << 0.0, -c.z(), c.y(), c.z(), 0.0, -c.x(), -c.y(), c.x(), 0.0;
  motion.bottomLeftCorner<3, 3>() = cross * pose.rotation_scale();
  return motion;
}

}  // namespace

BackgroundPoses::BackgroundPoses(const Eigen::Isometry3d& T_us_ct_initial,
                                 const RegistrationOptions& options, const Search& search) {
  StartOptions spread;
  if (options.stages.front().starts) {
    spread = *options.stages.front().starts;
  } else {
    spread.translation_mm = options.confidence.background_mm;
  }
  spread.count = 1 + options.confidence.background;
  const PoseParameters pose(T_us_ct_initial, search.points_us_mm());
  for (const PoseVector& start : spread_starts(pose, spread))
    poses_.push_back({pose.T_us_ct(start), {}});
  poses_.erase(poses_.begin());  // the initial pose itself
}

Background BackgroundPoses::of(const Similarity& similarity, const Candidate& best,
                               Search& search) const {
  std::vector<Candidate> poses = poses_;
  search.evaluate(similarity, poses);
  std::vector<double> values;
  for (const Candidate& pose : poses)
    if (std::isfinite(pose.value) && search.distance_mm(pose.T_us_ct, best.T_us_ct) > kAwayMm)
      values.push_back(pose.value);
  Background background;
  if (values.size() < 2) return background;
  std::sort(values.begin(), values.end());
  constexpr double kUpper = 0.9;
  constexpr double kUpperInDeviations = 1.2816;  // of a normal distribution
  const auto quantile = [&](double share) {
    return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
  };
  background.mean = quantile(0.5);
  background.deviation = (quantile(kUpper) - background.mean) / kUpperInDeviations;
  return background;
}

std::optional<PoseAccuracy> pose_accuracy(const Similarity& similarity, const Candidate& best,
                                          const ConfidenceOptions& options, const Search& search) {
  // Fewer parts than parameters, as of a global similarity, say nothing of how they scatter.
  constexpr std::size_t kLeastParts = 7;
  const std::vector<double> parts = similarity.parts(best.T_us_ct.inverse(), best.errors);
  if (parts.size() < kLeastParts) return std::nullopt;
  const PoseParameters pose(best.T_us_ct, search.points_us_mm());
  const Quadratic fit = quadratic_around(similarity, best, pose, parts, search);
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(-fit.hessian);
  // Directions in which the pose is at no maximum count as nearly flat.
  constexpr double kLeastCurvature = 0.03;
  const PoseVector& curvature = eigen.eigenvalues();
  const double least = kLeastCurvature * curvature.cwiseAbs().maxCoeff();
  if (!(least > 0.0)) return std::nullopt;
  const Matrix6d inverse = eigen.eigenvectors() *
                           curvature.cwiseMax(least).cwiseInverse().asDiagonal() *
                           eigen.eigenvectors().transpose();

  PoseAccuracy accuracy;
  // The parameters are scaled so that their variances sum to the mean square displacement.
  Matrix6d covariance = inverse * (fit.gradients.transpose() * fit.gradients) * inverse;
  accuracy.scatter_mm = std::sqrt(covariance.trace());
  covariance *= options.deviation_factor * options.deviation_factor;
  // What no image shows moves the field as a whole.
  covariance.diagonal().tail<3>().array() += options.systematic_mm * options.systematic_mm / 3.0;
  const Matrix6d motion = motion_of_parameters(pose);
  const Matrix6d moved = motion * covariance * motion.transpose();
  accuracy.covariance = 0.5 * (moved + moved.transpose());
  return accuracy;
}

double expected_error_mm(const Matrix6d& covariance,
                         const std::vector<Eigen::Vector3d>& points_us_mm) {
  return expected_tre_mm(covariance, points_us_mm).rms_mm;
}

namespace {

/// One gate: what it judges, the limit, and what failing it means.
struct Gate {
  const char* measure;
  bool at_least;
  double limit;
  const char* meaning;

  bool passed(const std::map<std::string, double>& measures) const {
    const auto found = measures.find(measure);
    if (found == measures.end()) return true;
    return at_least ? found->second >= limit : found->second <= limit;
  }
  std::string refusal(const std::map<std::string, double>& measures) const {
    return std::string(meaning) + ": " + measure + " is " + number(measures.at(measure)) +
           ", must be " + (at_least ? ">= " : "<= ") + number(limit);
  }
};

std::vector<Gate> gates(const ConfidenceOptions& options) {
  return {
      {"significance", true, options.min_significance, "the best pose is no better than chance"},
      {"margin", true, options.min_margin, "another pose is almost as good"},
      {"disagreement_mm", false, options.max_disagreement_mm, "the last two stages disagree"},
      {"displacement_mm", false, options.max_displacement_mm,
       "the pose is far from the initial one"},
      {"scatter_mm", false, options.max_scatter_mm, "parts of the ultrasound pull the pose apart"},
  };
}

}  // namespace

bool passes(const ConfidenceOptions& options, const std::map<std::string, double>& measures) {
  const std::vector<Gate> all = gates(options);
  return std::all_of(all.begin(), all.end(),
                     [&](const Gate& gate) { return gate.passed(measures); });
}

void judge(const ConfidenceOptions& options, RegistrationResult& result) {
  if (!(result.overlap >= options.min_overlap)) {
    result.status = RegistrationStatus::kNoOverlap;
    result.message = "CT and ultrasound share too little: overlap is " + number(result.overlap) +
                     ", must be >= " + number(options.min_overlap);
    return;
  }
  for (const Gate& gate : gates(options))
    if (!gate.passed(result.measures)) {
      result.status = RegistrationStatus::kLowConfidence;
      result.message = gate.refusal(result.measures);
      return;
    }
  result.status = RegistrationStatus::kRegistered;
  result.message = "all gates passed";
}

}  // namespace usct::registration
