#pragma once

#include <Eigen/Geometry>
#include <vector>

namespace usct::registration {

/// Positions spread over the field of view, US frame, mm. Distances between poses are mean
/// displacements of these points.
class FieldPoints {
 public:
  FieldPoints() = default;
  explicit FieldPoints(std::vector<Eigen::Vector3d> points_us_mm);

  double distance_mm(const Eigen::Isometry3d& T_a_us_ct, const Eigen::Isometry3d& T_b_us_ct) const;
  /// Whether the distance is larger than a limit: sooner answered than how large it is.
  bool are_apart(const Eigen::Isometry3d& T_a_us_ct, const Eigen::Isometry3d& T_b_us_ct,
                 double limit_mm) const;
  const std::vector<Eigen::Vector3d>& us_mm() const { return points_us_mm_; }
  const Eigen::Vector3d& centre_us_mm() const { return centre_us_mm_; }

 private:
  std::vector<Eigen::Vector3d> points_us_mm_;
  Eigen::Vector3d centre_us_mm_ = Eigen::Vector3d::Zero();
};

}  // namespace usct::registration
