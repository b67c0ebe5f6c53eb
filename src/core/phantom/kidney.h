#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "phantom/tube_tree.h"
#include "us_ct_registration/phantom/tissue.h"

namespace usct::phantom {

/// The properties of a kidney that do not follow from the seed.
struct KidneyContent {
  /// Length of vessels and ureter from the hilum, mm; the scene continues them beyond.
  double pedicle_mm = 25.0;
  bool tumour = false;
  bool cyst = false;
  bool stone = false;
  /// Scale of the collecting system, which is wide, as behind an obstruction (else it is almost
  /// collapsed).
  double calyx_scale = 1.0;
};

/// A randomised adult kidney in a frame of its own, mm: origin at its middle, x along the long axis
/// towards the upper pole, y away from the hilum, z completes them.
///
/// The surface is a bent ellipsoid with a hilum pressed in and low-order bumps, star-shaped about
/// the origin. Inside: cortex with columns, 8-14 pyramids, a fatty sinus with calyces and pelvis,
/// and a tree of arteries and veins that runs between the pyramids.
class Kidney {
 public:
  Kidney(std::uint64_t seed, const KidneyContent& content);

  /// The tissue at a point of the kidney, or of its pedicle; nothing elsewhere.
  std::optional<Tissue> tissue(const Eigen::Vector3d& p_mm) const;

  /// Radial coordinate: 0 at the origin, 1 on the surface, above 1 outside.
  double radial(const Eigen::Vector3d& p_mm) const;

  /// The point of the surface in a direction from the origin.
  Eigen::Vector3d surface_point_mm(const Eigen::Vector3d& direction) const;

  /// Positions at which the main artery, vein and ureter leave: the ends of the pedicle.
  const Eigen::Vector3d& artery_end_mm() const { return artery_end_; }
  const Eigen::Vector3d& vein_end_mm() const { return vein_end_; }

 private:
  struct Bump {
    Eigen::Vector3d direction;
    double amplitude;
    int order;  // 3 or 4
  };
  struct Lesion {
    Eigen::Vector3d centre;
    double radius;
    Tissue tissue;
    std::uint64_t seed;
  };

  struct Normalised {
    Eigen::Vector3d u;  // the unbent point over the half axes
    double length;      // of u
    double rho;         // radial coordinate
    double radius_mm;   // from the origin to the surface, in this direction
  };
  Normalised normalise(const Eigen::Vector3d& p_mm) const;
  Eigen::Vector3d point_at(const Eigen::Vector3d& unit_u, double rho) const;
  Eigen::Vector3d point_between(const Eigen::Vector3d& unit_u, double t) const;
  /// Radial coordinates, in a direction of u, of the sinus' wall and of the pyramids' bases.
  double sinus_wall(const Eigen::Vector3d& unit_u) const;
  double pyramid_base(const Normalised& n) const;
  Tissue parenchyma_or_sinus(const Normalised& n) const;
  std::optional<Tissue> lesion_at(const Eigen::Vector3d& p_mm) const;

  void place_pyramids(std::uint64_t seed);
  void grow_vessels(std::uint64_t seed, const KidneyContent& content);
  void grow_collecting_system(std::uint64_t seed, const KidneyContent& content);
  void place_lesions(std::uint64_t seed, const KidneyContent& content);

  Eigen::Vector3d half_axes_;
  double bend_mm_;
  double hilum_depth_;
  double cortex_mm_;
  Eigen::Vector3d sinus_axes_;
  std::vector<Bump> bumps_;
  std::vector<Eigen::Vector3d> pyramids_;
  double pyramid_angle_rad_ = 0.0;
  TubeTree tubes_;
  std::vector<Lesion> lesions_;
  Eigen::Vector3d artery_end_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d vein_end_ = Eigen::Vector3d::Zero();
};

}  // namespace usct::phantom
