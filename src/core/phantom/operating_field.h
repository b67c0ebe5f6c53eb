#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "us_ct_registration/phantom/anatomy.h"
#include "us_ct_registration/volume/volume.h"

namespace usct::phantom {

/// A rounded rod: a part of an instrument.
struct Rod {
  Eigen::Vector3d from_mm;
  Eigen::Vector3d to_mm;
  double radius_mm;
  /// Bright metal; else the dark shaft.
  bool is_metal;
};

/// A line of sight: `origin_mm + distance * direction`, direction of unit length.
struct Sight {
  Eigen::Vector3d origin_mm;
  Eigen::Vector3d direction;

  Eigen::Vector3d at(double distance_mm) const { return origin_mm + distance_mm * direction; }
};

/// The kidney with its lesions and vessels, exposed in a bed of fat, as distances to surfaces.
///
/// Coordinates are those of the CT. What lies behind the bed's surface, a bumpy plane across
/// `forward`, is hidden in fat; all tissue but the kidney's that lay before it has been removed.
class OperatingField {
 public:
  /// Throws InputError if the anatomy has no tumour.
  OperatingField(const Scene& scene, std::uint64_t seed);

  /// Lays the bed of fat across the direction of view.
  void lay_bed(const Eigen::Vector3d& forward);

  /// Mean position of the tumour's tissue.
  const Eigen::Vector3d& tumour_centre_mm() const { return tumour_centre_mm_; }
  /// Radius of a sphere around the centre that holds the tumour.
  double tumour_radius_mm() const { return tumour_radius_mm_; }

  struct Hit {
    double distance_mm;
    Eigen::Vector3d normal;
    /// Index of the rod; -1: tissue.
    int rod;
    Tissue tissue;
  };

  /// The first surface on a line of sight; nothing within `most_mm`.
  std::optional<Hit> first_hit(const Sight& sight, const std::vector<Rod>& rods,
                               double most_mm) const;

  /// Whether a line of sight meets the tumour, whatever lies before it.
  bool meets_tumour(const Sight& sight) const;

  /// The openness of the surroundings of a point of the surface: 1 on a ridge, towards 0 in a
  /// groove.
  double openness(const Eigen::Vector3d& p_mm, const Eigen::Vector3d& normal) const;

 private:
  double organ_distance(const Eigen::Vector3d& p_mm) const;
  double bed_distance(const Eigen::Vector3d& p_mm) const;
  double tissue_distance(const Eigen::Vector3d& p_mm) const;
  Tissue tissue_behind(const Eigen::Vector3d& p_mm, const Eigen::Vector3d& normal) const;

  std::uint64_t seed_;
  Eigen::Vector3d centre_mm_;
  Eigen::Vector3d forward_ = Eigen::Vector3d::UnitY();
  LabelVolume tissues_;
  /// Signed distances to the surface of all that is exposed, and to that of the tumour, mm.
  Volume<float> organ_mm_;
  Volume<float> tumour_mm_;
  Eigen::Vector3d tumour_centre_mm_ = Eigen::Vector3d::Zero();
  double tumour_radius_mm_ = 0.0;
};

}  // namespace usct::phantom
