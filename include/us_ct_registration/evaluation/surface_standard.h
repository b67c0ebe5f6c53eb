#pragma once

#include <Eigen/Geometry>
#include <array>
#include <string>
#include <vector>

/// The bronze standard of alignment from the surface of the kidney in both images (thesis 3.2.3),
/// where no fiducials are.
namespace usct {

/// An alignment of two surfaces.
struct SurfaceAlignment {
  Eigen::Isometry3d T_us_ct = Eigen::Isometry3d::Identity();
  /// Root mean square distance from each point of a surface to the nearest point of the other, both
  /// ways, mm.
  double distance_mm = 0.0;
};

/// The distance of the second best alignment over that of the best, where no segmentation is exact
/// to less than 0.1 mm.
double distinction_of(double best_mm, double second_mm);

struct SurfaceStandard {
  /// The four rotations that bring the principal axes together, best first: an axis has no
  /// direction, and two of the three may be reversed.
  std::array<SurfaceAlignment, 4> alignments;
  /// Standard deviations of the points along the principal axes, mm, ascending.
  Eigen::Vector3d deviations_us_mm;
  Eigen::Vector3d deviations_ct_mm;

  /// The distinction of the two best alignments: near 1, the surfaces do not tell which way round
  /// the kidney is, and the best alignment may be half a turn wrong.
  double distinction() const;
  /// The least ratio of neighbouring deviations, of both surfaces: near 1, a section of the surface
  /// is nearly round, and the rotation within it is arbitrary.
  double roundness_ratio() const;
};

/// Aligns the centroids and principal axes of two surfaces, given by points spread evenly over each
/// (the vertices of a segmentation). Throws InputError, naming the surface, if it has fewer than 10
/// points, a point is not finite, or the points lie on a line. The names are those of the surfaces
/// in its message, such as their files.
SurfaceStandard surface_standard(const std::vector<Eigen::Vector3d>& surface_us_mm,
                                 const std::vector<Eigen::Vector3d>& surface_ct_mm,
                                 const std::string& us_name = "ultrasound surface",
                                 const std::string& ct_name = "CT surface");

/// The 24 poses T_us_ct that bring the centroids and the principal axes together, in any order and
/// direction of the axes: those of a part of a surface have another order than those of the whole.
/// Throws as `surface_standard`.
std::vector<Eigen::Isometry3d> axis_alignments(const std::vector<Eigen::Vector3d>& surface_us_mm,
                                               const std::vector<Eigen::Vector3d>& surface_ct_mm,
                                               const std::string& us_name = "ultrasound surface",
                                               const std::string& ct_name = "CT surface");

}  // namespace usct
