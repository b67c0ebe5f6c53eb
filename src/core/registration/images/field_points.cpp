#include "registration/images/field_points.h"

#include "us_ct_registration/registration/pose_parameters.h"

namespace usct::registration {

FieldPoints::FieldPoints(std::vector<Eigen::Vector3d> points_us_mm)
    : points_us_mm_(std::move(points_us_mm)) {
  for (const Eigen::Vector3d& p : points_us_mm_) centre_us_mm_ += p;
  centre_us_mm_ /= static_cast<double>(points_us_mm_.size());
}

double FieldPoints::distance_mm(const Eigen::Isometry3d& T_a_us_ct,
                                const Eigen::Isometry3d& T_b_us_ct) const {
  return mean_displacement_mm(T_a_us_ct * T_b_us_ct.inverse(), Eigen::Isometry3d::Identity(),
                              points_us_mm_);
}

bool FieldPoints::are_apart(const Eigen::Isometry3d& T_a_us_ct, const Eigen::Isometry3d& T_b_us_ct,
                            double limit_mm) const {
  // The mean point moves no further than the points do in the mean.
  const Eigen::Isometry3d motion = T_a_us_ct * T_b_us_ct.inverse();
  return (motion * centre_us_mm_ - centre_us_mm_).norm() > limit_mm ||
         distance_mm(T_a_us_ct, T_b_us_ct) > limit_mm;
}

}  // namespace usct::registration
