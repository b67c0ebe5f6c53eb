#include "registration/search/block_matching.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"
#include "registration/motion_about.h"
#include "registration/search/block_sums.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::registration {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Blocks are compared at orientations that lie so far from each other at most, and summed at
/// rotations in between that lie so far from each other at most.
constexpr double kOrientationRad = 25.0 * kDegree;
constexpr double kRotationRad = 6.3 * kDegree;
/// More orientations along each axis, or translations farther than this, take longer and more
/// memory than what they find is worth.
constexpr int kMostParts = 4;
constexpr double kMostMm = 40.0;

/// Rotation vectors in the middles of count^3 equal parts of a cube around 0.
std::vector<Vector3d> middles_of_parts(double half_width, int count) {
  const double width = 2.0 * half_width / count;
  const auto middle = [&](int i) { return -half_width + (i + 0.5) * width; };
  std::vector<Vector3d> middles;
  for (int x = 0; x < count; ++x)
    for (int y = 0; y < count; ++y)
      for (int z = 0; z < count; ++z) middles.emplace_back(middle(x), middle(y), middle(z));
  return middles;
}

int parts_of(double width, double most) {
  return std::max(1, static_cast<int>(std::ceil(width / most)));
}

Matrix3d rotation(const Vector3d& vector) {
  const double angle = vector.norm();
  if (!(angle > 0.0)) return Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

/// The rotations at which blocks are summed near each orientation.
std::vector<Matrix3d> rotations_near(const StartOptions& region) {
  const double width =
      2.0 * region.rotation_rad / parts_of(2.0 * region.rotation_rad, kOrientationRad);
  std::vector<Matrix3d> rotations;
  for (const Vector3d& vector : middles_of_parts(0.5 * width, parts_of(width, kRotationRad)))
    rotations.push_back(rotation(vector));
  return rotations;
}

}  // namespace

bool BlockMatching::covers(const StartOptions& region) {
  return region.translation_mm <= kMostMm &&
         parts_of(2.0 * region.rotation_rad, kOrientationRad) <= kMostParts;
}

std::vector<Candidate> BlockMatching::poses(const Isometry3d& T_us_ct_initial,
                                            const StartOptions& region, const Isometry3d& mirror,
                                            const FieldPoints& field, double distinct_mm,
                                            std::size_t most, Run& run) const {
  const int parts = parts_of(2.0 * region.rotation_rad, kOrientationRad);
  const UltrasoundCells cells(*us_, mirror);
  std::vector<UltrasoundBlock> blocks = cells.blocks();
  if (blocks.empty()) return {};
  const Vector3d& centre = field.centre_us_mm();
  const BlockSums sums(cells, std::move(blocks), rotations_near(region), region.translation_mm,
                       centre);
  const std::vector<Vector3d> orientations = middles_of_parts(region.rotation_rad, parts);
  std::vector<std::vector<Candidate>> found(orientations.size());
  parallel_for(static_cast<int>(orientations.size()), [&](int i) {
    run.check_cancelled();
    const auto at = static_cast<std::size_t>(i);
    const Isometry3d T_us_ct = motion_about(centre, rotation(orientations[at])) * T_us_ct_initial;
    for (const BlockPlace& place : sums.best(*ct_, T_us_ct))
      found[at].push_back(
          {sums.T_us_ct_at(place, T_us_ct), {}, static_cast<double>(place.explained), 0.0});
  });
  std::vector<Candidate> all;
  for (const std::vector<Candidate>& of_orientation : found)
    all.insert(all.end(), of_orientation.begin(), of_orientation.end());
  return best_distinct(std::move(all), distinct_mm, most, field);
}

}  // namespace usct::registration
