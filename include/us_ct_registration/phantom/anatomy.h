#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "us_ct_registration/phantom/tissue.h"

namespace usct::phantom {

/// A ball that is too small for the raster of tissue: a fiducial, a bubble.
struct Ball {
  Eigen::Vector3d centre_ct_mm;
  double radius_mm;
  Tissue tissue;
};

/// The tissue at each point, in CT coordinates (LPS, mm), at the time of the CT. CT and ultrasound
/// are both formed from the anatomy alone, which has neither grid nor noise.
class Anatomy {
 public:
  virtual ~Anatomy() = default;

  /// The tissue at a point anywhere in space, without the balls.
  virtual Tissue tissue(const Eigen::Vector3d& p_ct_mm) const = 0;

  /// The coordinates, in mm, at which the texture of the tissue is evaluated: the point itself, or
  /// coordinates that follow the layers and fibres of the tissue.
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

/// Smooth variations of the echogenicity of a tissue that the CT does not show, correlated over
/// about 3 and 10 mm: mean 0, standard deviation 1.
double echo_texture_at(Tissue tissue, const Eigen::Vector3d& p_ct_mm, std::uint64_t seed);

/// An anatomy with its properties, and the probe that scans it.
struct Scene {
  std::shared_ptr<const Anatomy> anatomy;
  TissueTable tissues;
  /// Pose of the probe: origin at the middle of the array's surface, x lateral, y into the body,
  /// z elevation.
  Eigen::Isometry3d T_ct_probe = Eigen::Isometry3d::Identity();
  Eigen::Vector3d kidney_centre_ct_mm = Eigen::Vector3d::Zero();
  /// Points spread evenly over the kidney's surface.
  std::vector<Eigen::Vector3d> kidney_surface_ct_mm;
  std::vector<Eigen::Vector3d> fiducials_ct_mm;
  /// The middle of a CT of the kidney.
  Eigen::Vector3d ct_centre_mm = Eigen::Vector3d::Zero();
  /// Depth below the array that shows all of the kidney, mm.
  double suggested_depth_mm = 0.0;
  /// Radius of curvature, along the sweep (elevation), of the surface under the probe, mm.
  double surface_radius_mm = 1e6;
  /// Transmit frequency that reaches that depth, MHz.
  double suggested_frequency_mhz = 0.0;
};

}  // namespace usct::phantom
