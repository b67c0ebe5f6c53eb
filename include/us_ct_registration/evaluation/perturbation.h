#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

/// Random rigid motions of the US frame that put a registration's start away from the truth.
namespace usct {

/// A motion that moves the points by exactly `displacement_mm` on average: a rotation about their
/// centroid, then a translation. Axis and direction of the translation are uniform on the sphere;
/// the angle is uniform up to `max_rotation_rad`, or up to the angle that alone moves the points
/// that far; the length of the translation follows from the displacement.
///
/// The same seed gives the same motion. Throws InputError if there is no point, one is not finite,
/// the displacement is not finite and >= 0, or the angle is not in [0, pi].
Eigen::Isometry3d random_motion(std::uint64_t seed, const std::vector<Eigen::Vector3d>& points_mm,
                                double displacement_mm, double max_rotation_rad);

/// A box of motions, given by half its widths.
struct MotionBox {
  double rotation_rad = 0.0;
  double translation_mm = 0.0;

  /// Throws InputError, naming `source`, unless the rotation is in [0, pi] and the translation
  /// finite and >= 0.
  void validate(const std::string& source) const;
};

/// The thesis' perturbation: angles about the x, y and z axis of the US frame and translations
/// along them, each uniform within the box. The rotation is about the points' centroid, by x first.
/// Throws InputError as above.
Eigen::Isometry3d random_motion_in_box(std::uint64_t seed,
                                       const std::vector<Eigen::Vector3d>& points_mm,
                                       const MotionBox& box);

/// Displacements of `count` starts, spread evenly over `bins` of equal width in [min_mm, max_mm]:
/// the number per bin differs by one at most, and those of a bin are spread evenly within it, each
/// at random within its share. Throws InputError unless 0 <= min_mm <= max_mm, both finite, and
/// count and bins are >= 1.
std::vector<double> spread_displacements_mm(std::uint64_t seed, int count, double min_mm,
                                            double max_mm, int bins);

}  // namespace usct
