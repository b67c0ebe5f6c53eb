#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "phantom/kidney.h"
#include "phantom/tube_tree.h"
#include "random.h"
#include "us_ct_registration/phantom/anatomy.h"
#include "us_ct_registration/phantom/phantom.h"

namespace usct::phantom {

/// A torso around the kidney. Torso coordinates, mm: origin in the middle of the body at the
/// kidney's height, x towards the side of the kidney ("lateral"), y posterior, z superior. The
/// right side is the left one mirrored, with the liver in place of the spleen.
class PatientAnatomy : public Anatomy {
 public:
  PatientAnatomy(std::uint64_t seed, const AnatomyOptions& options);

  Tissue tissue(const Eigen::Vector3d& p_ct_mm) const override;

  /// Coordinates (along the skin, depth, z), because layers and fibres of the wall follow the skin.
  Eigen::Vector3d texture_point_mm(const Eigen::Vector3d& p_ct_mm, Tissue tissue) const override;

  /// Maps the torso to the CT. Not rigid for a right kidney (mirrored).
  Eigen::Vector3d ct_from_torso(const Eigen::Vector3d& p) const {
    return T_ct_torso_ * mirrored(p);
  }
  Eigen::Vector3d ct_direction(const Eigen::Vector3d& d) const {
    return T_ct_torso_.linear() * mirrored(d);
  }
  Eigen::Vector3d torso_from_ct(const Eigen::Vector3d& p) const {
    return mirrored(T_torso_ct_ * p);
  }

  const Kidney& kidney() const { return kidney_; }
  const Eigen::Isometry3d& T_torso_kidney() const { return T_torso_kidney_; }

  /// Unit vector out of the body at its surface.
  Eigen::Vector3d skin_normal(const Eigen::Vector3d& p) const;

  /// The point at which a ray from inside the body leaves it.
  Eigen::Vector3d skin_point(const Eigen::Vector3d& from, const Eigen::Vector3d& outwards) const;

 private:
  /// A loop of bowel: an ellipsoid with gas and content.
  struct Loop {
    Eigen::Vector3d centre;
    Eigen::Vector3d radii;
    double gas_level;  // gas lies where the normalised y is below this
  };

  Eigen::Vector3d mirrored(const Eigen::Vector3d& p) const {
    return right_ ? Eigen::Vector3d(-p.x(), p.y(), p.z()) : p;
  }
  double depth_below_skin(const Eigen::Vector3d& p) const;
  bool within_organ(const Eigen::Vector3d& p, const Eigen::Vector3d& centre,
                    const Eigen::Vector3d& radii) const;

  /// The tissue of a part of the body at a point of the torso; nothing outside that part.
  std::optional<Tissue> wall_tissue(const Eigen::Vector3d& p, double depth) const;
  std::optional<Tissue> kidney_tissue(const Eigen::Vector3d& p) const;
  std::optional<Tissue> muscle_or_vessel(const Eigen::Vector3d& p) const;
  std::optional<Tissue> bowel_tissue(const Eigen::Vector3d& p) const;
  Tissue interior_tissue(const Eigen::Vector3d& p) const;

  Eigen::Vector3d wall_point(double angle_deg, double z, double depth_mm) const;
  void place_kidney(Sequence& random);
  void place_bones(Sequence& random);
  void place_vessels();
  void place_bowel(Sequence& random);
  void place_bubbles(Sequence& random, int count);

  std::uint64_t seed_;
  Kidney kidney_;
  bool right_ = false;
  Eigen::Isometry3d T_ct_torso_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_torso_ct_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_torso_kidney_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_kidney_torso_ = Eigen::Isometry3d::Identity();
  double half_width_mm_ = 0.0;
  double half_depth_mm_ = 0.0;
  double fat_mm_ = 0.0;
  double muscle_mm_ = 0.0;
  /// The radial coordinate, about the kidney, of the fascia around its fat.
  double gerota_ = 0.0;
  TubeTree bones_;
  TubeTree vessels_;
  std::vector<Loop> bowel_;
};

}  // namespace usct::phantom
