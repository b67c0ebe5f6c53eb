#include "registration/confidence.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "parallel.h"
#include "us_ct_registration/evaluation/target_errors.h"

namespace usct::registration {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Poses this close to the best one may profit from it, mm.
constexpr double kAwayMm = 10.0;
/// Steps of the numerical derivatives: beyond the grain of the sampling, within the peak; mm.
constexpr double kStepMm = 0.7;

/// Gradients of the parts (columns: parameters) and Hessian of their sum, by differences.
struct Derivatives {
  Eigen::MatrixXd gradients;
  Matrix6d hessian;
};

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.3g", value);
  return text;
}

/// Similarity, and its parts, where the parameters are displaced along one or two axes.
class Displaced {
 public:
  Displaced(const Similarity& similarity, const Candidate& best, const PoseParameters& pose)
      : similarity_(similarity), best_(best), pose_(pose) {}

  std::vector<double> parts(const PoseVector& x) const {
    return similarity_.parts(pose_.T_us_ct(x).inverse(), best_.errors);
  }
  double sum(const PoseVector& x) const {
    return similarity_.evaluate(pose_.T_us_ct(x).inverse(), best_.errors).value;
  }

 private:
  const Similarity& similarity_;
  const Candidate& best_;
  const PoseParameters& pose_;
};

double total(const std::vector<double>& parts) {
  double sum = 0.0;
  for (const double part : parts) sum += part;
  return sum;
}

Derivatives derivatives(const Displaced& at, const Search& search) {
  // 0: the centre; 1...12: plus and minus along each axis; 13...27: plus along each pair.
  constexpr int kAxes = 6;
  constexpr int kOnAxes = 1 + 2 * kAxes;
  std::vector<PoseVector> places{PoseVector::Zero()};
  for (int i = 0; i < kAxes; ++i)
    for (const double sign : {1.0, -1.0}) places.emplace_back(sign * kStepMm * PoseVector::Unit(i));
  for (int i = 0; i < kAxes; ++i)
    for (int j = 0; j < i; ++j)
      places.emplace_back(kStepMm * (PoseVector::Unit(i) + PoseVector::Unit(j)));

  std::vector<std::vector<double>> parts(static_cast<std::size_t>(kOnAxes));
  std::vector<double> sums(places.size());
  parallel_for(static_cast<int>(places.size()), [&](int i) {
    search.check_cancelled();
    const auto place = static_cast<std::size_t>(i);
    if (i < kOnAxes) {
      parts[place] = at.parts(places[place]);
      sums[place] = total(parts[place]);
    } else {
      sums[place] = at.sum(places[place]);
    }
  });

  Derivatives result;
  result.gradients.resize(static_cast<Eigen::Index>(parts[0].size()), kAxes);
  const auto plus = [](int axis) { return static_cast<std::size_t>(1 + 2 * axis); };
  for (int i = 0; i < kAxes; ++i) {
    const std::vector<double>& a = parts[plus(i)];
    const std::vector<double>& b = parts[plus(i) + 1];
    for (std::size_t p = 0; p < a.size(); ++p)
      result.gradients(static_cast<Eigen::Index>(p), i) = (a[p] - b[p]) / (2.0 * kStepMm);
    result.hessian(i, i) =
        (sums[plus(i)] - 2.0 * sums[0] + sums[plus(i) + 1]) / (kStepMm * kStepMm);
  }
  std::size_t pair = kOnAxes;
  for (int i = 0; i < kAxes; ++i)
    for (int j = 0; j < i; ++j, ++pair)
      result.hessian(i, j) = result.hessian(j, i) =
          (sums[pair] - sums[plus(i)] - sums[plus(j)] + sums[0]) / (kStepMm * kStepMm);
  return result;
}

/// What small parameters do: d(w, t) / d(parameters), about the origin of the US frame.
Matrix6d motion_of_parameters(const PoseParameters& pose) {
  Matrix6d motion = Matrix6d::Zero();
  motion.topLeftCorner<3, 3>() = pose.rotation_scale();
  motion.bottomRightCorner<3, 3>().setIdentity();
  // p + w x (p - c) + t = p + w x p + (t + c x w).
  const Eigen::Vector3d c = pose.centre_us_mm();
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

PoseAccuracy pose_accuracy(const Similarity& similarity, const Candidate& best,
                           const ConfidenceOptions& options, Search& search) {
  // Fewer parts than parameters, as of a global similarity, say nothing of how they scatter.
  constexpr std::size_t kLeastParts = 7;
  if (similarity.parts(best.T_us_ct.inverse(), best.errors).size() < kLeastParts) return {};
  const PoseParameters pose(best.T_us_ct, search.points_us_mm());
  const Derivatives d = derivatives(Displaced(similarity, best, pose), search);
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(-d.hessian);
  PoseAccuracy accuracy;
  accuracy.is_maximum = eigen.eigenvalues().minCoeff() > 0.0;
  // Where it is not (a flat direction, and noise), the direction counts as nearly flat.
  constexpr double kLeastCurvature = 0.05;
  const Eigen::Matrix<double, 6, 1> curvature = eigen.eigenvalues();
  if (!(curvature.mean() > 0.0)) return accuracy;
  const Matrix6d inverse =
      eigen.eigenvectors() *
      curvature.cwiseMax(kLeastCurvature * curvature.mean()).cwiseInverse().asDiagonal() *
      eigen.eigenvectors().transpose();
  Matrix6d covariance = inverse * (d.gradients.transpose() * d.gradients) * inverse;
  covariance *= options.deviation_factor * options.deviation_factor;
  // The parameters are scaled so that their variances sum to the mean square displacement.
  covariance.diagonal().array() += options.systematic_mm * options.systematic_mm / 6.0;
  const Matrix6d motion = motion_of_parameters(pose);
  const Matrix6d result = motion * covariance * motion.transpose();
  accuracy.covariance = 0.5 * (result + result.transpose());
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

std::vector<Gate> gates(const ConfidenceOptions& options,
                        const std::map<std::string, double>& measures) {
  std::vector<Gate> all = {
      {"significance", true, options.min_significance, "the best pose is no better than chance"},
      {"confirmation", true, options.min_confirmation,
       "a second similarity does not confirm the pose"},
      {"margin", true, options.min_margin, "another pose is almost as good"},
      {"disagreement_mm", false, options.max_disagreement_mm, "the last two stages disagree"},
      {"displacement_mm", false, options.max_displacement_mm,
       "the pose is far from the initial one"},
  };
  const auto significance = measures.find("significance");
  if (significance == measures.end() || significance->second < options.sure_significance) {
    all.push_back({"is_maximum", true, 1.0, "the last stage has no maximum at the pose"});
    all.push_back({"expected_error_mm", false, options.max_expected_error_mm,
                   "the pose is not well defined"});
  }
  return all;
}

}  // namespace

bool passes(const ConfidenceOptions& options, const std::map<std::string, double>& measures) {
  const std::vector<Gate> all = gates(options, measures);
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
  for (const Gate& gate : gates(options, result.measures))
    if (!gate.passed(result.measures)) {
      result.status = RegistrationStatus::kLowConfidence;
      result.message = gate.refusal(result.measures);
      return;
    }
  result.status = RegistrationStatus::kRegistered;
  result.message = "all gates passed";
}

}  // namespace usct::registration
