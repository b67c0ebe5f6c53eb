#pragma once

#include <Eigen/Geometry>
#include <array>

#include "us_ct_registration/rendering/registration_pictures.h"

namespace usct::rendering {

/// The extent of the known ultrasound along the axes of the pictures (columns of a rotation from
/// these axes to the US frame).
struct Field {
  Eigen::Vector3d middle_mm = Eigen::Vector3d::Zero();
  Eigen::AlignedBox3d box_mm;
};

/// Draws the panels of one registration, all with the same levels and the same brightness. The
/// ultrasound and the CT must outlive this object.
class Panels {
 public:
  /// For panels of the ultrasound alone; functions with a pose must not be called. Throws
  /// InputError if an option is invalid or the mask is empty.
  Panels(const ScanConverted& us, const RegistrationPictureOptions& options);

  /// Levels that `options` leaves open are chosen at the pose `T_us_ct_of_levels`. Throws as the
  /// other constructor.
  Panels(const ScanConverted& us, const CtVolume& ct, const Eigen::Isometry3d& T_us_ct_of_levels,
         const RegistrationPictureOptions& options);

  /// Three orthogonal planes: lateral-axial, elevation-axial, lateral-elevation.
  const std::array<SlicePlane, 3>& planes() const { return planes_; }

  /// The point in which they meet, US frame, mm.
  const Eigen::Vector3d& centre_us_mm() const { return centre_us_mm_; }

  /// The levels of the iso-lines.
  const std::vector<ContourLevel>& levels() const { return options_.levels; }

  /// A plane parallel to `plane`, at a fraction of the field's extent; `at_mm` becomes its
  /// position along the normal.
  SlicePlane parallel(SlicePlane plane, double fraction, double& at_mm) const;

  /// The ultrasound alone.
  Picture ultrasound(const SlicePlane& plane) const;

  /// The CT alone.
  Picture computed(const SlicePlane& plane, const Eigen::Isometry3d& T_us_ct) const;

  /// `picture` with the iso-lines of the CT.
  Picture with_contours(Picture picture, const SlicePlane& plane,
                        const Eigen::Isometry3d& T_us_ct) const;

  /// The ultrasound with the iso-lines of the CT; the lines fade where there is no ultrasound to
  /// compare them with.
  Picture overlay(const SlicePlane& plane, const Eigen::Isometry3d& T_us_ct) const;

  /// Writes the names of the levels in their colours, from (x, y) to the right.
  void draw_legend(Picture& header, int x, int y) const;

 private:
  const ScanConverted& us_;
  const CtVolume* ct_ = nullptr;
  RegistrationPictureOptions options_;
  double gain_;
  Field field_;
  Eigen::Vector3d centre_us_mm_;
  std::array<SlicePlane, 3> planes_;
};

}  // namespace usct::rendering
