#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "evaluation/bright_components.h"
#include "order_statistics.h"
#include "require.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/evaluation/ball_detection.h"
#include "us_ct_registration/formatted.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;
using evaluation::Component;
using evaluation::for_each_voxel;

/// A ball being measured, in coordinates of millimetres along the volume's index axes.
struct Measured {
  Vector3d centre_mm;
  double contrast_hu = 0.0;
  /// The largest over the least standard deviation of the metal along any direction, in units of
  /// those that a ball has in this image.
  double elongation = 1.0;
  /// Whether the metal is that of an object at the seed, and not of branches of vessels around it.
  bool is_compact = false;
};

class BallFit {
 public:
  BallFit(const CtVolume& ct, double diameter_mm)
      : ct_(ct), spacing_mm_(ct.grid.spacing_mm), radius_mm_(0.5 * diameter_mm) {
    reach_mm_ = radius_mm_ + 0.6 + spacing_mm_.minCoeff();
    // The blur of a scanner, and the blur by the extent of the voxels.
    constexpr double kScannerBlurMm = 0.4;
    blur_mm_ = (spacing_mm_.cwiseAbs2().array() / 12.0 + kScannerBlurMm * kScannerBlurMm).sqrt();
  }

  /// Share of its contrast that a ball has in its middle after the blur, in closed form for a blur
  /// that is equal along all axes.
  double middle_share() const {
    const double ratio = radius_mm_ / std::cbrt(blur_mm_.prod());
    return std::erf(ratio / std::sqrt(2.0)) -
           std::sqrt(2.0 / kPi) * ratio * std::exp(-0.5 * ratio * ratio);
  }

  /// The balls of a component, moved to the centroids of their metal until they stay.
  std::vector<Measured> measure(const Component& component) const {
    std::vector<Vector3d> seeds_mm = seeds(component);
    std::vector<Measured> balls = settled(seeds_mm);
    // Balls do not share space: of two that do, one is a maximum that noise made.
    while (const std::size_t excess = first_that_overlaps(balls)) {
      seeds_mm.erase(seeds_mm.begin() + static_cast<std::ptrdiff_t>(excess));
      balls = settled(seeds_mm);
    }
    double brightest_hu = -std::numeric_limits<double>::infinity();
    for (const Vector3i& v : component.voxels) brightest_hu = std::max(brightest_hu, value(v));
    for (std::size_t b = 0; b < balls.size(); ++b)
      balls[b].is_compact = is_compact(balls[b], seeds_mm[b], brightest_hu);
    return balls;
  }

  bool is_cut(const Vector3d& p_mm) const {
    const Vector3d low = (p_mm.array() - radius_mm_).matrix().cwiseQuotient(spacing_mm_);
    const Vector3d high = (p_mm.array() + radius_mm_).matrix().cwiseQuotient(spacing_mm_);
    // A voxel more than the ball, for the blur.
    return (low.array() < 0.5).any() ||
           (high.array() > ct_.grid.size.cast<double>().array() - 1.5).any();
  }

 private:
  static constexpr double kLeastOfBest = 0.6;

  /// The maxima of the component, smoothed by a ball: one for each ball that it holds.
  std::vector<Vector3d> seeds(const Component& component) const {
    std::vector<std::pair<double, Vector3d>> means;
    for (const Vector3i& v : component.voxels) {
      const Vector3d p = v.cast<double>().cwiseProduct(spacing_mm_);
      double sum = 0.0;
      double weights = 0.0;
      for_each_voxel(around(p, radius_mm_ + spacing_mm_.maxCoeff()), [&](const Vector3i& q) {
        // Nearer than the radius a voxel counts in full; beyond, its share falls over one voxel.
        const double beyond = (offset_mm(q, p).norm() - radius_mm_) / spacing_mm_.maxCoeff();
        const double weight = std::clamp(0.5 - beyond, 0.0, 1.0);
        sum += weight * value(q);
        weights += weight;
      });
      means.emplace_back(sum / weights, p);
    }
    std::sort(means.begin(), means.end(), [](const auto& a, const auto& b) {
      return a.first != b.first ? a.first > b.first
                                : a.second.squaredNorm() < b.second.squaredNorm();
    });
    std::vector<Vector3d> found;
    for (const auto& [mean, p] : means) {
      const auto is_near = [&, &at = p](const Vector3d& other) {
        // Neighbouring voxels may share one maximum that lies between them.
        const Vector3d voxels = (at - other).cwiseQuotient(spacing_mm_);
        return (at - other).norm() < 1.6 * radius_mm_ || voxels.cwiseAbs().maxCoeff() < 1.5;
      };
      if (mean > kLeastOfBest * means[0].first && std::none_of(found.begin(), found.end(), is_near))
        found.push_back(p);
    }
    return found;
  }

  std::vector<Measured> settled(const std::vector<Vector3d>& seeds_mm) const {
    constexpr int kMostMoves = 100;
    constexpr double kStaysMm = 1e-4;
    std::vector<Measured> balls;
    for (const Vector3d& seed : seeds_mm) balls.push_back({seed});
    for (int move = 0; move < kMostMoves; ++move) {
      double largest_mm = 0.0;
      for (std::size_t b = 0; b < balls.size(); ++b) {
        const Vector3d before = balls[b].centre_mm;
        update(b, balls);
        largest_mm = std::max(largest_mm, (balls[b].centre_mm - before).norm());
      }
      if (largest_mm < kStaysMm) break;
    }
    return balls;
  }

  /// The first ball that overlaps with one before it by a fifth of the diameter; 0 if none does.
  std::size_t first_that_overlaps(const std::vector<Measured>& balls) const {
    for (std::size_t b = 1; b < balls.size(); ++b)
      for (std::size_t other = 0; other < b; ++other)
        if ((balls[b].centre_mm - balls[other].centre_mm).norm() < 1.6 * radius_mm_) return b;
    return 0;
  }

  /// Whether the centre stayed at the seed, and the component is as bright as a ball with this
  /// metal is.
  bool is_compact(const Measured& ball, const Vector3d& seed_mm, double brightest_hu) const {
    constexpr double kLeastOfExpected = 0.4;
    return (ball.centre_mm - seed_mm).norm() < radius_mm_ + 0.5 * spacing_mm_.maxCoeff() &&
           brightest_hu > kLeastOfExpected * middle_share() * ball.contrast_hu;
  }

  double volume_mm3() const { return 4.0 / 3.0 * kPi * std::pow(radius_mm_, 3.0); }
  double value(const Vector3i& v) const { return ct_.at(v.x(), v.y(), v.z()); }
  Vector3d offset_mm(const Vector3i& v, const Vector3d& p_mm) const {
    return v.cast<double>().cwiseProduct(spacing_mm_) - p_mm;
  }

  Region around(const Vector3d& p_mm, double reach_mm) const {
    const Vector3d low = (p_mm.array() - reach_mm).matrix().cwiseQuotient(spacing_mm_);
    const Vector3d high = (p_mm.array() + reach_mm).matrix().cwiseQuotient(spacing_mm_);
    const Vector3i begin = low.array().ceil().matrix().cast<int>().cwiseMax(Vector3i::Zero());
    const Vector3i last =
        high.array().floor().matrix().cast<int>().cwiseMin(ct_.grid.size - Vector3i::Ones());
    return {begin, (last - begin + Vector3i::Ones()).cwiseMax(Vector3i::Zero())};
  }

  /// Share with which a voxel counts. The window's edges are soft, so that voxels do not enter and
  /// leave as the centre moves. The part that a neighbouring ball may reach is left out, and its
  /// mirror image as well, which keeps the window symmetric about the centre.
  double share_of(const Vector3d& offset, const std::vector<Measured>& balls,
                  std::size_t own) const {
    const double edge_mm = spacing_mm_.maxCoeff();
    const auto inside = [&](double beyond_mm) {
      return std::clamp(0.5 - beyond_mm / edge_mm, 0.0, 1.0);
    };
    double share = inside(offset.norm() - reach_mm_);
    for (std::size_t other = 0; other < balls.size(); ++other) {
      const Vector3d way = balls[other].centre_mm - balls[own].centre_mm;
      const double half_mm = 0.5 * way.norm() - blur_mm_.minCoeff();
      if (other != own && half_mm < reach_mm_)
        share *= inside(std::abs(offset.dot(way.normalized())) - half_mm);
    }
    return share;
  }

  double background(const Vector3d& p_mm) const {
    std::vector<double> shell;
    const double outer_mm = reach_mm_ + 2.0 * spacing_mm_.maxCoeff();
    for_each_voxel(around(p_mm, outer_mm), [&](const Vector3i& v) {
      const double distance = offset_mm(v, p_mm).norm();
      if (distance > reach_mm_ && distance < outer_mm) shell.push_back(value(v));
    });
    if (shell.empty()) return 0.0;
    return value_of_rank(shell, shell.size() / 2);
  }

  void update(std::size_t own, std::vector<Measured>& balls) const {
    Measured& ball = balls[own];
    const Vector3d centre = ball.centre_mm;
    const double surroundings_hu = background(centre);
    double sum = 0.0;
    Vector3d first = Vector3d::Zero();
    Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
    for_each_voxel(around(centre, reach_mm_ + spacing_mm_.maxCoeff()), [&](const Vector3i& v) {
      const Vector3d offset = offset_mm(v, centre);
      const double share = share_of(offset, balls, own);
      if (share == 0.0) return;
      const double metal = share * (value(v) - surroundings_hu);
      sum += metal;
      first += metal * offset;
      second += metal * offset * offset.transpose();
    });
    if (!(sum > 0.0)) return;
    const Vector3d shift = first / sum;
    ball.contrast_hu = sum * spacing_mm_.prod() / volume_mm3();
    ball.elongation = elongation(second / sum - shift * shift.transpose());
    // A centre that left its ball found something else; it then fails by its contrast.
    ball.centre_mm += shift.norm() > radius_mm_ ? Vector3d(radius_mm_ * shift.normalized()) : shift;
  }

  double elongation(const Eigen::Matrix3d& covariance) const {
    const double ball_variance = radius_mm_ * radius_mm_ / 5.0;
    const Vector3d expected = (blur_mm_.cwiseAbs2().array() + ball_variance).sqrt();
    const Eigen::Matrix3d scaled =
        expected.cwiseInverse().asDiagonal() * covariance * expected.cwiseInverse().asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scaled, Eigen::EigenvaluesOnly);
    const double least = std::max(solver.eigenvalues()[0], 1e-6);
    return std::sqrt(std::max(solver.eigenvalues()[2], least) / least);
  }

  const CtVolume& ct_;
  Vector3d spacing_mm_;
  double radius_mm_;
  double reach_mm_ = 0.0;
  Vector3d blur_mm_;
};

/// Sorts a ball into those found and those refused.
void judge(const Grid& grid, const BallFit& fit, const Measured& ball, const CtBallOptions& options,
           BallDetection& found) {
  constexpr double kMostElongated = 1.6;
  const Vector3d centre_mm =
      grid.physical_from_index(ball.centre_mm.cwiseQuotient(grid.spacing_mm));
  // Half of a ball that the border cuts may be missing.
  const bool is_cut = fit.is_cut(ball.centre_mm);
  if (ball.contrast_hu < (is_cut ? 0.5 : 1.0) * options.least_contrast_hu) return;
  if (is_cut)
    found.refused.push_back({centre_mm, "is cut by the border of the CT"});
  else if (ball.elongation > kMostElongated)
    found.refused.push_back(
        {centre_mm, formatted("is %.1f times as long as a ball", ball.elongation)});
  else
    found.balls.push_back({centre_mm, ball.contrast_hu});
}

/// Moves those balls to the refused that hold another amount of metal than most.
void refuse_unequal(BallDetection& found) {
  if (found.balls.size() < 3) return;
  const double middle = found.balls[found.balls.size() / 2].contrast;
  std::vector<DetectedBall> equal;
  for (const DetectedBall& ball : found.balls) {
    const double share = ball.contrast / middle;
    if (share > 1.6 || share < 0.6)
      found.refused.push_back(
          {ball.centre_mm, formatted("holds %.1f times the metal of the others", share)});
    else
      equal.push_back(ball);
  }
  found.balls = equal;
}

}  // namespace

void CtBallOptions::validate() const {
  require_within("ball options", "diameter_mm", diameter_mm, 0.3, 10.0);
  require_within("ball options", "least_contrast_hu", least_contrast_hu, 100.0, 30000.0);
}

BallDetection detect_balls(const CtVolume& ct, const CtBallOptions& options) {
  options.validate();
  ct.validate("CT");
  const double largest_spacing = ct.grid.spacing_mm.maxCoeff();
  if (largest_spacing > 1.5 * options.diameter_mm)
    throw InputError("CT", formatted("voxels are %g mm long, must be at most 1.5 times the balls' "
                                     "diameter of %g mm",
                                     largest_spacing, options.diameter_mm));
  const BallFit fit(ct, options.diameter_mm);
  const double threshold_hu = 0.6 * options.least_contrast_hu * fit.middle_share();
  // Room for three balls in a row with their blur.
  const Vector3d largest_mm =
      (3.0 * options.diameter_mm + 1.0) * Vector3d::Ones() + 2.0 * ct.grid.spacing_mm;
  BallDetection found;
  for (const Component& component : evaluation::bright_components(ct, threshold_hu, largest_mm))
    for (const Measured& ball : fit.measure(component))
      if (ball.is_compact) judge(ct.grid, fit, ball, options, found);
  std::sort(found.balls.begin(), found.balls.end(),
            [](const DetectedBall& a, const DetectedBall& b) { return a.contrast > b.contrast; });
  refuse_unequal(found);
  return found;
}

}  // namespace usct
