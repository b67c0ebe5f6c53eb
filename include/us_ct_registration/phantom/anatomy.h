#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "us_ct_registration/phantom/tissue.h"

namespace usct::phantom {

/// A ball that is too small for a raster of tissue to hold: a fiducial, a bubble.
struct Ball {
  Eigen::Vector3d centre_ct_mm;
  double radius_mm;
  Tissue tissue;
};

/// What is where, in CT coordinates (LPS, mm), as it was when the CT was taken. Both images are
/// formed from this and from nothing else; it knows of no grid and no noise.
class Anatomy {
 public:
  virtual ~Anatomy() = default;

  /// The tissue at a point, anywhere in space, balls left out.
  virtual Tissue tissue(const Eigen::Vector3d& p_ct_mm) const = 0;

  /// Where the tissue's texture is looked up, mm: the point itself, or coordinates that follow the
  /// tissue's layers and fibres.
  virtual Eigen::Vector3d texture_point_mm(const Eigen::Vector3d& p_ct_mm, Tissue tissue) const;

  const std::vector<Ball>& balls() const { return balls_; }

 protected:
  std::vector<Ball> balls_;
};

/// Smooth variations of a tissue at a point, the same ones for CT and ultrasound: mean 0, standard
/// deviation 1.
double texture_at(const Anatomy& anatomy, const TissueProperties& properties, Tissue tissue,
                  const Eigen::Vector3d& p_ct_mm, std::uint64_t seed);

/// Fibrous sheets in a tissue: 1 on them, falling to 0 beside.
double sheet_at(const Anatomy& anatomy, const TissueProperties& properties, Tissue tissue,
                const Eigen::Vector3d& p_ct_mm, std::uint64_t seed);

/// An anatomy, what is known about it, and how a probe looks at it.
struct Scene {
  std::shared_ptr<const Anatomy> anatomy;
  TissueTable tissues;
  /// Pose of the probe: origin at the middle of the array's surface, x lateral, y into the body,
  /// z elevation.
  Eigen::Isometry3d T_ct_probe = Eigen::Isometry3d::Identity();
  Eigen::Vector3d kidney_centre_ct_mm = Eigen::Vector3d::Zero();
  /// Spread evenly over the kidney's surface.
  std::vector<Eigen::Vector3d> kidney_surface_ct_mm;
  std::vector<Eigen::Vector3d> fiducials_ct_mm;
  /// Where the middle of a CT of the kidney lies.
  Eigen::Vector3d ct_centre_mm = Eigen::Vector3d::Zero();
  /// Depth below the array that shows all of the kidney, mm.
  double suggested_depth_mm = 0.0;
  /// How the surface under the probe curves away along the sweep (elevation), mm.
  double surface_radius_mm = 1e6;
  /// Transmit frequency that reaches that depth, MHz.
  double suggested_frequency_mhz = 0.0;
};

}  // namespace usct::phantom
