#include "us_ct_registration/evaluation/perturbation.h"

#include <algorithm>
#include <cmath>

#include "geometry/centroid.h"
#include "random.h"
#include "require.h"
#include "us_ct_registration/geometry/angles.h"
#include "us_ct_registration/registration/pose_parameters.h"

namespace usct {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

/// Purposes of random numbers, each of which has its own stream.
enum Purpose : std::uint64_t { kMotion = 1, kMotionInBox, kDisplacements };

/// The angle at which chords `2 r sin(angle / 2)` of the points are `displacement_mm` on average.
double angle_that_moves_by(double displacement_mm, const Vector3d& centre_mm, const Vector3d& axis,
                           const std::vector<Vector3d>& points_mm) {
  double radius_mm = 0.0;
  for (const Vector3d& p : points_mm)
    radius_mm += axis.cross(p - centre_mm).norm() / static_cast<double>(points_mm.size());
  if (displacement_mm >= 2.0 * radius_mm) return kPi;
  return 2.0 * std::asin(displacement_mm / (2.0 * radius_mm));
}

}  // namespace

Isometry3d random_motion(std::uint64_t seed, const std::vector<Vector3d>& points_mm,
                         double displacement_mm, double max_rotation_rad) {
  require_not_negative("start", "displacement_mm", displacement_mm);
  require(max_rotation_rad >= 0.0 && max_rotation_rad <= kPi, "start", "max_rotation_rad",
          max_rotation_rad, "within [0, pi]");
  const Vector3d centre_mm = centroid(points_mm);
  Sequence random(seed, kMotion);
  const Vector3d axis = random.direction();
  const Vector3d direction = random.direction();
  const double largest_rad =
      std::min(max_rotation_rad, angle_that_moves_by(displacement_mm, centre_mm, axis, points_mm));
  const double angle_rad = random.between(0.0, largest_rad);
  const auto motion = [&](double length_mm) {
    return Isometry3d(Eigen::Translation3d(centre_mm + length_mm * direction) *
                      Eigen::AngleAxisd(angle_rad, axis) * Eigen::Translation3d(-centre_mm));
  };
  // The mean displacement is convex in the length, too small at 0, and at least the length (the
  // centroid moves that far), so it has the wanted value at one length.
  double low_mm = 0.0;
  double high_mm = displacement_mm;
  while (true) {
    const double middle_mm = 0.5 * (low_mm + high_mm);
    if (middle_mm <= low_mm || middle_mm >= high_mm) return motion(high_mm);
    const double moved_mm =
        mean_displacement_mm(motion(middle_mm), Isometry3d::Identity(), points_mm);
    (moved_mm < displacement_mm ? low_mm : high_mm) = middle_mm;
  }
}

void MotionBox::validate(const std::string& source) const {
  require(rotation_rad >= 0.0 && rotation_rad <= kPi, source, "rotation_rad", rotation_rad,
          "within [0, pi]");
  require_not_negative(source, "translation_mm", translation_mm);
}

Isometry3d random_motion_in_box(std::uint64_t seed, const std::vector<Vector3d>& points_mm,
                                const MotionBox& box) {
  box.validate("start");
  const Vector3d centre_mm = centroid(points_mm);
  Sequence random(seed, kMotionInBox);
  const auto within = [&](double bound) {
    const double x = random.between(-bound, bound);
    const double y = random.between(-bound, bound);
    const double z = random.between(-bound, bound);
    return Vector3d(x, y, z);
  };
  const Vector3d angles_rad = within(box.rotation_rad);
  const Vector3d translation_mm = within(box.translation_mm);
  return Eigen::Translation3d(centre_mm + translation_mm) *
         Eigen::AngleAxisd(angles_rad.z(), Vector3d::UnitZ()) *
         Eigen::AngleAxisd(angles_rad.y(), Vector3d::UnitY()) *
         Eigen::AngleAxisd(angles_rad.x(), Vector3d::UnitX()) * Eigen::Translation3d(-centre_mm);
}

std::vector<double> spread_displacements_mm(std::uint64_t seed, int count, double min_mm,
                                            double max_mm, int bins) {
  require(count >= 1, "starts", "count", count, ">= 1");
  require(bins >= 1, "starts", "bins", bins, ">= 1");
  require_not_negative("starts", "min_displacement_mm", min_mm);
  require(std::isfinite(max_mm) && max_mm >= min_mm, "starts", "max_displacement_mm", max_mm,
          "finite and >= the smallest");
  Sequence random(seed, kDisplacements);
  std::vector<double> displacements_mm;
  for (int i = 0; i < count; ++i) {
    const int bin = i % bins;
    const int in_bin = (count - bin + bins - 1) / bins;
    const int place = i / bins;
    const double within_bin = (place + random.between(0.0, 1.0)) / in_bin;
    displacements_mm.push_back(min_mm + (max_mm - min_mm) * (bin + within_bin) / bins);
  }
  return displacements_mm;
}

}  // namespace usct
