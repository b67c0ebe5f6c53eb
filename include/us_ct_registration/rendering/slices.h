#pragma once

#include <Eigen/Geometry>
#include <array>

#include "us_ct_registration/rendering/picture.h"
#include "us_ct_registration/volume/volume.h"

/// Slices of CT and ultrasound on common planes of the US frame, for people to look at.
namespace usct {

/// A plane in the US frame (mm), sampled with square pixels. Pixel (x, y) lies at
/// `centre_mm + (x - (width - 1) / 2) * pixel_mm * right + (y - (height - 1) / 2) * pixel_mm *
/// down`.
struct SlicePlane {
  std::string name;
  Eigen::Vector3d centre_mm;
  Eigen::Vector3d right;
  Eigen::Vector3d down;
  double pixel_mm = 0.5;
  int width = 0;
  int height = 0;

  Eigen::Vector3d point_mm(int x, int y) const {
    return centre_mm + (x - 0.5 * (width - 1)) * pixel_mm * right +
           (y - 0.5 * (height - 1)) * pixel_mm * down;
  }
};

/// The three planes through `centre_mm` along the axes of the US frame, each as large as `extent`:
/// lateral-axial (a frame of the probe), elevation-axial, and lateral-elevation (constant depth).
std::array<SlicePlane, 3> orthogonal_planes(const Grid& extent, const Eigen::Vector3d& centre_mm,
                                            double pixel_mm);

/// HU range that is drawn from black to white.
struct CtWindow {
  double low_hu = -160.0;
  double high_hu = 340.0;
};

/// Scan-converted ultrasound; dark blue outside the mask.
Picture render_us(const UsVolume& us, const MaskVolume& mask, const SlicePlane& plane);

/// The CT at its pose in the US frame; dark blue outside the CT.
Picture render_ct(const CtVolume& ct, const Eigen::Isometry3d& T_us_ct, CtWindow window,
                  const SlicePlane& plane);

/// CT in orange, ultrasound in blue: where both are bright the picture is white.
Picture blend(const Picture& us, const Picture& ct);

/// Draws the points (mm, frame of the plane) that lie within `distance_mm` of the plane, 3 pixels
/// wide.
void draw_points(Picture& picture, const SlicePlane& plane,
                 const std::vector<Eigen::Vector3d>& points_mm, double distance_mm,
                 const Picture::Colour& colour);

/// A checkerboard of `squares_across` squares per row, ultrasound and CT in turn: at a right pose,
/// edges continue across squares.
Picture checkerboard(const Picture& us, const Picture& ct, int squares_across = 6);

}  // namespace usct
