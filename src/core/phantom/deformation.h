#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "us_ct_registration/phantom/anatomy.h"

namespace usct::phantom {

/// A smooth displacement field u in CT coordinates: a point at p in the CT is at p + u(p) during
/// the ultrasound. It is the sum of vector-valued Gaussian bumps at the kidney and the dent that
/// the probe makes.
class Deformation {
 public:
  Deformation() = default;
  /// The largest displacement of the points of the kidney's surface by the bumps alone is
  /// `deformation_mm`; the dent is `indentation_mm` deep at the array's middle.
  Deformation(const Scene& scene, double deformation_mm, double indentation_mm, std::uint64_t seed);

  Eigen::Vector3d displaced(const Eigen::Vector3d& p_mm) const { return p_mm + at(p_mm); }
  /// The inverse of `displaced`, by fixed-point iteration.
  Eigen::Vector3d original(const Eigen::Vector3d& p_mm) const;

 private:
  struct Bump {
    Eigen::Vector3d centre_mm;
    Eigen::Vector3d displacement_mm;
    double inverse_two_variance;
  };
  Eigen::Vector3d at(const Eigen::Vector3d& p_mm) const;
  Eigen::Vector3d bumps_at(const Eigen::Vector3d& p_mm) const;

  std::vector<Bump> bumps_;
  double indentation_mm_ = 0.0;
  Eigen::Isometry3d T_probe_ct_ = Eigen::Isometry3d::Identity();
  Eigen::Vector3d pressing_ = Eigen::Vector3d::Zero();
};

/// The pose of the displaced anatomy in the probe frame: p_probe = T_probe_ct * (p + u(p)).
struct Placement {
  Eigen::Isometry3d T_probe_ct = Eigen::Isometry3d::Identity();
  Deformation deformation;

  Eigen::Vector3d probe_from_ct(const Eigen::Vector3d& p_ct_mm) const {
    return T_probe_ct * deformation.displaced(p_ct_mm);
  }
  Eigen::Vector3d ct_from_probe(const Eigen::Vector3d& p_probe_mm) const {
    return deformation.original(T_probe_ct.inverse() * p_probe_mm);
  }
};

}  // namespace usct::phantom
