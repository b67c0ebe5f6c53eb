#include "registration/pose_accuracy.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "parallel.h"
#include "us_ct_registration/geometry/target_errors.h"
#include "us_ct_registration/registration/pose_parameters.h"

namespace usct::registration {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// 54 unit vectors: the shortest ones of the lattice E6*, a spherical design of strength 5, so that
/// a quadratic fitted to values there does not depend on the orientation of the axes.
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

/// The quadratic that best fits a similarity around a pose.
struct Quadratic {
  Eigen::MatrixXd gradients;  // gradients of the parts in rows
  Matrix6d hessian;           // Hessian of the sum of the parts
};

/// `centre` holds the parts at the pose itself.
Quadratic quadratic_around(const Similarity& similarity, const Candidate& best,
                           const PoseParameters& pose, const std::vector<double>& centre,
                           double around_mm, const Run& run) {
  std::vector<PoseVector> places = even_directions();
  for (PoseVector& place : places) place *= around_mm;
  std::vector<std::vector<double>> parts(places.size());
  parallel_for(static_cast<int>(places.size()), [&](int i) {
    run.check_cancelled();
    const auto at = static_cast<std::size_t>(i);
    parts[at] = similarity.parts({pose.T_us_ct(places[at]).inverse(), best.errors});
  });

  constexpr double kAxes = 6.0;
  const double square = around_mm * around_mm;
  const auto count = static_cast<double>(places.size());
  const auto rows = static_cast<Eigen::Index>(centre.size());
  Quadratic fit{Eigen::MatrixXd::Zero(rows, 6), Matrix6d::Zero()};
  double mean = 0.0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Eigen::Map<const Eigen::VectorXd> values(parts[i].data(), rows);
    fit.gradients += kAxes / (count * square) * values * places[i].transpose();
    fit.hessian += values.sum() / count * places[i] * places[i].transpose();
    mean += values.sum() / count;
  }
  // Without its trace, the mean of f x x^T is that of the Hessian times r^4 / (n (n + 2)); the
  // trace of the Hessian follows from the mean of f minus the centre.
  fit.hessian.diagonal().array() -= mean * square / kAxes;
  fit.hessian *= kAxes * (kAxes + 2.0) / (square * square);
  const double at_centre = std::accumulate(centre.begin(), centre.end(), 0.0);
  fit.hessian.diagonal().array() += 2.0 * (mean - at_centre) / square;
  return fit;
}

/// Derivative of the motion by the parameters, d(w, t) / d(parameters), for a motion about the
/// origin of the US frame.
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

std::optional<PoseAccuracy> pose_accuracy(const Similarity& similarity, const Candidate& best,
                                          const ConfidenceOptions& options,
                                          const FieldPoints& field, const Run& run) {
  // Six or fewer parts, as in a global similarity, give no estimate of how six parameters scatter.
  constexpr std::size_t kLeastParts = 7;
  const std::vector<double> parts = similarity.parts(best.pose());
  if (parts.size() < kLeastParts) return std::nullopt;
  const PoseParameters pose(best.T_us_ct, field.us_mm());
  const Quadratic fit =
      quadratic_around(similarity, best, pose, parts, options.scatter.around_mm, run);
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(-fit.hessian);
  // A direction in which the pose is at no maximum counts as nearly flat.
  const PoseVector& curvature = eigen.eigenvalues();
  const double least = options.scatter.least_curvature * curvature.cwiseAbs().maxCoeff();
  if (!(least > 0.0)) return std::nullopt;
  const Matrix6d inverse = eigen.eigenvectors() *
                           curvature.cwiseMax(least).cwiseInverse().asDiagonal() *
                           eigen.eigenvectors().transpose();

  PoseAccuracy accuracy;
  // The parameters are scaled so that their variances sum to the mean square displacement.
  Matrix6d covariance = inverse * (fit.gradients.transpose() * fit.gradients) * inverse;
  accuracy.scatter_mm = std::sqrt(covariance.trace());
  covariance *= options.deviation_factor * options.deviation_factor;
  // Errors that no image shows are modelled as a shift of the whole field.
  covariance.diagonal().tail<3>().array() += options.systematic_mm * options.systematic_mm / 3.0;
  const Matrix6d motion = motion_of_parameters(pose);
  const Matrix6d moved = motion * covariance * motion.transpose();
  accuracy.covariance = 0.5 * (moved + moved.transpose());
  return accuracy;
}

Assessor::Assessor(const ImagePyramid& images, const Eigen::Isometry3d& T_us_ct_initial,
                   const RegistrationOptions& options)
    : images_(images),
      T_us_ct_initial_(T_us_ct_initial),
      options_(options),
      background_(T_us_ct_initial, images.prepared.field, options.search.starts,
                  options.confidence.background) {}

Assessment Assessor::assess(const std::vector<Candidate>& optima, const Candidate& refined,
                            Run& run) const {
  const FieldPoints& field = images_.prepared.field;
  const Candidate& best = optima.front();
  const Background background = background_.of(images_.deciding(), best, run);
  Assessment result;
  Measures& measures = result.measures;
  measures.overlap = refined.overlap;
  measures.significance = background.significance(best.value);
  measures.margin = margin(optima, background, run);
  measures.displacement_mm = field.distance_mm(refined.T_us_ct, T_us_ct_initial_);
  if (const std::optional<RefinementOptions>& refinement = options_.refinement) {
    measures.disagreement_mm = field.distance_mm(refined.T_us_ct, best.T_us_ct);
    if (refinement->depth_error > 0.0) measures.depth_error = refined.errors.depth;
    if (refinement->sweep_error > 0.0) measures.sweep_error = refined.errors.sweep;
  }
  if (const std::optional<PoseAccuracy> accuracy = accuracy_of(refined, run)) {
    measures.scatter_mm = accuracy->scatter_mm;
    measures.expected_error_mm = expected_tre_mm(accuracy->covariance, field.us_mm()).rms_mm;
    result.covariance = accuracy->covariance;
  }
  return result;
}

void Assessor::drop_distant(std::vector<Candidate>& optima, const Run& run) const {
  const std::optional<double>& most_mm = options_.confidence.gates.max_displacement_mm;
  if (!most_mm) return;
  while (optima.size() > 1 &&
         images_.prepared.field.distance_mm(optima.front().T_us_ct, T_us_ct_initial_) > *most_mm &&
         !holds_together(optima.front(), run))
    optima.erase(optima.begin());
}

/// Height of the best optimum above the best rival, as a share of its height above the background.
double Assessor::margin(const std::vector<Candidate>& optima, const Background& background,
                        const Run& run) const {
  const Candidate& best = optima.front();
  const auto lower = [&](const Candidate& other) {
    return (best.value - other.value) / (best.value - background.median);
  };
  const double least = options_.confidence.gates.min_margin.value_or(0.0);
  for (std::size_t i = 1; i < optima.size(); ++i) {
    if (images_.prepared.field.distance_mm(optima[i].T_us_ct, best.T_us_ct) <=
        options_.confidence.rival_mm)
      continue;
    // An optimum about which its parts disagree is no rival. This costly check is made only for an
    // optimum that would fail the gate.
    if (lower(optima[i]) >= least || holds_together(optima[i], run)) return lower(optima[i]);
  }
  // An optimum that is missing from a full list is lower than the list's last one.
  const auto most = static_cast<std::size_t>(options_.search.most_optima);
  return optima.size() < most ? 1.0 : lower(optima.back());
}

bool Assessor::holds_together(const Candidate& candidate, const Run& run) const {
  const std::optional<double>& most_mm = options_.confidence.gates.max_scatter_mm;
  if (!most_mm) return true;
  const std::optional<PoseAccuracy> accuracy = accuracy_of(candidate, run);
  return !accuracy || accuracy->scatter_mm <= *most_mm;
}

/// Accuracy by the second similarity, which did not choose the pose.
std::optional<PoseAccuracy> Assessor::accuracy_of(const Candidate& candidate,
                                                  const Run& run) const {
  if (!images_.scatter_similarity) return std::nullopt;
  return pose_accuracy(*images_.scatter_similarity, candidate, options_.confidence,
                       images_.prepared.field, run);
}

}  // namespace usct::registration
