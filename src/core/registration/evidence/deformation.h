#pragma once

#include <Eigen/Geometry>
#include <vector>

namespace usct::registration {

/// The part of the field of view in which the motion of tissue counts.
struct TissueRegion {
  /// Places this close to this point count.
  Eigen::Vector3d centre_us_mm;
  double radius_mm;
  /// The direction across the frames of the sweep, US frame, unit length.
  Eigen::Vector3d sweep_axis_us;
};

/// A place of the field of view, and how far it would rather lie elsewhere, US frame, mm.
struct Wish {
  Eigen::Vector3d place_mm;
  Eigen::Vector3d motion_mm;
  /// The share of this wish in means over places; >= 0.
  double weight;
};

/// Finds the translation at which a function is highest, from its values at some translations. A
/// quadratic function is fitted to all of them, so that its peak may lie between them. If it has
/// no peak within 1.5 times their reach, the best of the translations is taken.
class PeakFinder {
 public:
  /// `moves_mm` must determine a quadratic function, as a lattice of 27 does.
  explicit PeakFinder(std::vector<Eigen::Vector3d> moves_mm);

  /// `values` has one for each translation.
  Eigen::Vector3d peak_mm(const std::vector<double>& values) const;

 private:
  std::vector<Eigen::Vector3d> moves_mm_;
  double reach_mm_;
  /// Maps values to the coefficients of the quadratic function that fits them best.
  Eigen::Matrix<double, 10, Eigen::Dynamic> fit_;
};

/// The rigid motion, US frame, that explains most of the motions: the one by which the places would
/// rather lie together. The motions are taken to be small beside the extent of the places; of what
/// few places leave open the least is taken. The identity if no weight is there.
Eigen::Isometry3d rigid_motion(const std::vector<Wish>& wishes);

/// About how far tissue has moved relative to the pose: root mean square of the motions near the
/// centre by their weights, mm; 0 if no weight is there. A wrong step of the motor, or a wrong path
/// of the tracker, stretches the field across the frames. What it explains of all motions is no
/// motion of tissue, and is left out.
double deformation_mm(const std::vector<Wish>& wishes, const TissueRegion& region);

}  // namespace usct::registration
