#include "us_ct_registration/baselines/unscented_filter.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <functional>
#include <numeric>
#include <string>

#include "baselines/motion.h"
#include "baselines/nearest_points.h"
#include "geometry/point_spread.h"
#include "require.h"
#include "us_ct_registration/error.h"

namespace usct {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Points = std::vector<Vector3d>;

/// A pose and its uncertainty. The state is a motion of the reference pose in the US frame: a shift
/// and a turn about the centre.
class PoseFilter {
 public:
  PoseFilter(const Isometry3d& T_us_ct, const Vector3d& centre_ct_mm,
             const UnscentedFilterOptions& options)
      : options_(options), reference_(T_us_ct), centre_ct_mm_(centre_ct_mm) {
    restart();
  }

  Isometry3d pose() const { return moved_reference(state_); }
  const Matrix6d& covariance() const { return covariance_; }
  Vector3d centre_us_mm() const { return pose() * centre_ct_mm_; }

  /// Starts the next pass: the pose so far becomes the reference, with the uncertainty of the
  /// start.
  void restart() {
    reference_ = pose();
    state_.setZero();
    Vector6d deviations;
    deviations << Vector3d::Constant(options_.shift_deviation_mm),
        Vector3d::Constant(options_.turn_deviation_rad);
    covariance_ = deviations.cwiseAbs2().asDiagonal();
  }

  /// Takes a point of the ultrasound that shows a point of the CT, with a standard deviation along
  /// each axis. The observation has no derivatives here: 12 poses, placed so that they have the
  /// state's mean and covariance, show where the point would be (Julier and Uhlmann 1997).
  void take(const Vector3d& p_us_mm, const Vector3d& p_ct_mm, double deviation_mm) {
    const Matrix6d root = std::sqrt(6.0) * Matrix6d(covariance_.llt().matrixL());
    Eigen::Matrix<double, 6, 12> offsets;
    offsets << root, -root;
    Eigen::Matrix<double, 3, 12> observed;
    for (int i = 0; i < 12; ++i)
      observed.col(i) = moved_reference(state_ + offsets.col(i)) * p_ct_mm;
    const Vector3d mean = observed.rowwise().mean();
    observed.colwise() -= mean;
    const Matrix3d spread =
        observed * observed.transpose() / 12.0 + deviation_mm * deviation_mm * Matrix3d::Identity();
    const Eigen::Matrix<double, 6, 3> gain =
        offsets * observed.transpose() / 12.0 * spread.inverse();
    state_ += gain * (p_us_mm - mean);
    covariance_ -= gain * spread * gain.transpose();
    covariance_ = 0.5 * (covariance_ + covariance_.transpose()).eval();
  }

 private:
  Isometry3d moved_reference(const Vector6d& motion) const {
    const Vector3d centre = reference_ * centre_ct_mm_;
    return motion_about(centre, motion.head<3>(), motion.tail<3>()) * reference_;
  }

  const UnscentedFilterOptions& options_;
  Isometry3d reference_;
  Vector3d centre_ct_mm_;
  Vector6d state_ = Vector6d::Zero();
  Matrix6d covariance_ = Matrix6d::Identity();
};

/// An order in which successive points lie far apart, whatever the order of the file: a part of the
/// surface alone would turn the state to where it fits that part.
std::vector<std::size_t> scattered_order(std::size_t count) {
  auto stride = static_cast<std::size_t>(0.618 * static_cast<double>(count)) + 1;
  while (std::gcd(stride, count) != 1) ++stride;
  std::vector<std::size_t> order(count);
  for (std::size_t i = 0; i < count; ++i) order[i] = i * stride % count;
  return order;
}

/// The points of the CT that those of the ultrasound show, in a pose.
using Partners = std::function<Points(const Isometry3d& T_us_ct)>;

UnscentedFilterResult run_filter(const Points& us_mm, const Points& ct_mm, const Isometry3d& start,
                                 const UnscentedFilterOptions& options, const Partners& partners) {
  options.validate();
  require_spread(us_mm, 0.05, "ultrasound points");
  require_spread(ct_mm, 0.05, "CT points");
  const Vector3d centre = point_spread(ct_mm).centroid_mm;
  const std::vector<std::size_t> order = scattered_order(us_mm.size());
  PoseFilter filter(start, centre, options);
  UnscentedFilterResult result;
  for (int pass = 0; pass < options.passes; ++pass) {
    if (pass > 0) filter.restart();
    const Points shown_mm = partners(filter.pose());
    for (const std::size_t i : order) {
      filter.take(us_mm[i], shown_mm[i], options.point_deviation_mm);
      if (pass + 1 == options.passes)
        result.shift_deviations_mm.push_back(
            std::sqrt(filter.covariance().topLeftCorner<3, 3>().trace()));
    }
  }
  result.T_us_ct = filter.pose();
  result.covariance = filter.covariance();
  result.centre_us_mm = filter.centre_us_mm();
  const Points shown_mm = partners(result.T_us_ct);
  double squares = 0.0;
  for (std::size_t i = 0; i < us_mm.size(); ++i)
    squares += (us_mm[i] - result.T_us_ct * shown_mm[i]).squaredNorm();
  result.distance_mm = std::sqrt(squares / static_cast<double>(us_mm.size()));
  return result;
}

}  // namespace

void UnscentedFilterOptions::validate() const {
  const std::string source = "unscented filter options";
  require_positive(source, "shift_deviation_mm", shift_deviation_mm);
  require_within(source, "turn_deviation_rad", turn_deviation_rad, 1e-6, 1.0);
  require_positive(source, "point_deviation_mm", point_deviation_mm);
  require(passes >= 1, source, "passes", passes, "at least 1");
}

UnscentedFilterResult filter_pairs(const Points& points_us_mm, const Points& points_ct_mm,
                                   const Isometry3d& start_T_us_ct,
                                   const UnscentedFilterOptions& options) {
  if (points_us_mm.size() != points_ct_mm.size())
    throw InputError("points", std::to_string(points_us_mm.size()) + " of the ultrasound and " +
                                   std::to_string(points_ct_mm.size()) +
                                   " of the CT, must be as many");
  return run_filter(points_us_mm, points_ct_mm, start_T_us_ct, options,
                    [&](const Isometry3d&) { return points_ct_mm; });
}

UnscentedFilterResult filter_surfaces(const Points& surface_us_mm, const Points& surface_ct_mm,
                                      const Isometry3d& start_T_us_ct,
                                      const UnscentedFilterOptions& options) {
  const NearestPoints nearest(surface_ct_mm);
  return run_filter(surface_us_mm, surface_ct_mm, start_T_us_ct, options,
                    [&](const Isometry3d& T_us_ct) {
                      const Isometry3d T_ct_us = T_us_ct.inverse();
                      Points nearest_mm;
                      for (const Vector3d& p : surface_us_mm)
                        nearest_mm.push_back(surface_ct_mm[nearest.nearest(T_ct_us * p).index]);
                      return nearest_mm;
                    });
}

}  // namespace usct
