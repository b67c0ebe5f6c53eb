#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "us_ct_registration/geometry/scan_geometry.h"
#include "us_ct_registration/ultrasound/prescan_volume.h"
#include "us_ct_registration/ultrasound/tracked_images.h"

namespace usct {

/// Planes in space that hold values, the common interface of the frames of a tracked sweep and of
/// tracked images. Coordinates of a plane are two coordinates within it, which each kind of plane
/// defines, and the signed distance from it in mm.
class Planes {
 public:
  virtual ~Planes() = default;
  virtual int count() const = 0;
  /// Maps points in the US frame, in mm, to coordinates of a plane.
  virtual Eigen::Affine3d T_plane_us(int plane) const = 0;
  /// Millimetres per unit of the two coordinates within the plane.
  virtual Eigen::Vector2d unit_mm(int plane) const = 0;
  /// Distance of neighbouring recorded values, in the direction in which they are closest.
  virtual double pitch_mm(int plane) const = 0;
  /// All known values lie within these coordinates of their plane.
  virtual Eigen::AlignedBox2d bounds() const = 0;
  /// The interpolated value at a point of a plane; empty where it is unknown.
  virtual std::optional<float> at(int plane, double u, double v) const = 0;
};

/// The frames of a tracked sweep; coordinates are those of the frame (x lateral, y axial), in mm.
/// The volume must outlive this object.
class PreScanPlanes final : public Planes {
 public:
  explicit PreScanPlanes(const PreScanVolume& prescan);

  int count() const override { return geometry_.frames(); }
  Eigen::Affine3d T_plane_us(int plane) const override;
  Eigen::Vector2d unit_mm(int) const override { return Eigen::Vector2d::Ones(); }
  double pitch_mm(int) const override { return geometry_.axial.spacing_mm; }
  Eigen::AlignedBox2d bounds() const override { return bounds_; }
  std::optional<float> at(int plane, double u, double v) const override;

 private:
  const PreScanVolume& prescan_;
  const ScanGeometry& geometry_;
  int samples_;
  int lines_;
  ArrayInverse inverse_;
  Eigen::AlignedBox2d bounds_;
};

/// Tracked B-mode images; coordinates are column and row. The images must outlive this object.
class ImagePlanes final : public Planes {
 public:
  explicit ImagePlanes(const TrackedImages& images);

  int count() const override { return images_.count(); }
  Eigen::Affine3d T_plane_us(int plane) const override;
  Eigen::Vector2d unit_mm(int plane) const override;
  double pitch_mm(int plane) const override { return unit_mm(plane).minCoeff(); }
  Eigen::AlignedBox2d bounds() const override { return bounds_; }
  std::optional<float> at(int plane, double u, double v) const override;

 private:
  std::size_t pixel(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(images_.width) +
           static_cast<std::size_t>(column);
  }
  bool is_shown(int column, int row) const {
    return images_.shown.empty() || images_.shown[pixel(column, row)] != 0;
  }

  const TrackedImages& images_;
  Eigen::AlignedBox2d bounds_;
};

}  // namespace usct
