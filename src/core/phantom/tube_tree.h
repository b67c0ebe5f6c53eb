#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "us_ct_registration/phantom/tissue.h"

namespace usct::phantom {

/// Branching tubes of varying radius, looked up through a raster of cells.
class TubeTree {
 public:
  /// Adds a tapered piece with round ends. Where tubes overlap, the one that was added first
  /// counts.
  void add(const Eigen::Vector3d& from_mm, const Eigen::Vector3d& to_mm, double radius_from_mm,
           double radius_to_mm, Tissue tissue);
  /// Adds a smooth curve through the points (Catmull-Rom).
  void add_curve(const std::vector<Eigen::Vector3d>& points_mm, double radius_from_mm,
                 double radius_to_mm, Tissue tissue);
  /// Must be called once, after the last tube.
  void build_raster();

  struct Hit {
    Tissue tissue;
    double depth_mm;  // below the tube's wall
  };
  std::optional<Hit> find(const Eigen::Vector3d& p_mm) const;

 private:
  struct Segment {
    Eigen::Vector3d from_mm;
    Eigen::Vector3d axis;  // to - from
    double axis_squared;
    double radius_from_mm;
    double radius_to_mm;
    Tissue tissue;
  };
  std::size_t offset(const Eigen::Vector3i& cell) const {
    return (static_cast<std::size_t>(cell.z()) * static_cast<std::size_t>(cells_.y()) +
            static_cast<std::size_t>(cell.y())) *
               static_cast<std::size_t>(cells_.x()) +
           static_cast<std::size_t>(cell.x());
  }

  std::vector<Segment> segments_;
  Eigen::AlignedBox3d box_;
  Eigen::Vector3i cells_ = Eigen::Vector3i::Zero();
  std::vector<std::vector<int>> segments_of_cell_;
};

}  // namespace usct::phantom
