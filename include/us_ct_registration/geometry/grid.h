#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <string>

namespace usct {

/// Positions of the voxels of a volume: a regular grid with orthogonal axes.
///
/// Index coordinates are continuous; voxel (i, j, k) has its centre at index (i, j, k) and i is the
/// fastest axis in memory. Physical coordinates are millimetres in the volume's own frame (LPS for
/// a CT). `p = origin_mm + direction * spacing_mm.asDiagonal() * index`.
struct Grid {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Ones();
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();
  /// Columns are the unit directions of the index axes. Orthonormal; a determinant of -1 (a
  /// left-handed storage order) is allowed, shear is not.
  Eigen::Matrix3d direction = Eigen::Matrix3d::Identity();

  std::size_t voxel_count() const {
    return static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()) *
           static_cast<std::size_t>(size.z());
  }
  std::size_t offset(int i, int j, int k) const {
    return (static_cast<std::size_t>(k) * static_cast<std::size_t>(size.y()) +
            static_cast<std::size_t>(j)) *
               static_cast<std::size_t>(size.x()) +
           static_cast<std::size_t>(i);
  }

  Eigen::Vector3d physical_from_index(const Eigen::Vector3d& index) const {
    return origin_mm + direction * spacing_mm.cwiseProduct(index);
  }
  Eigen::Vector3d index_from_physical(const Eigen::Vector3d& p_mm) const {
    return (direction.transpose() * (p_mm - origin_mm)).cwiseQuotient(spacing_mm);
  }
  Eigen::Affine3d T_physical_index() const;
  Eigen::Affine3d T_index_physical() const;

  /// Physical position of the centre of the whole block of voxels.
  Eigen::Vector3d centre_mm() const {
    return physical_from_index(0.5 * (size.cast<double>() - Eigen::Vector3d::Ones()));
  }

  /// Throws InputError, naming `source`, if a size is < 1, the number of voxels exceeds the range
  /// of memory addresses, a spacing is not finite and > 0, an origin is not finite, or the
  /// direction is not orthonormal within 1e-4.
  void validate(const std::string& source) const;
};

/// Whether both grids have the same size, and spacing, origin and direction that are equal within
/// 1e-6.
bool same_grid(const Grid& a, const Grid& b);

/// The smallest axis-aligned grid (direction = identity) of isotropic `spacing_mm` that covers the
/// box [min_mm, max_mm]. Throws InputError for an empty box or a spacing that is not > 0.
Grid grid_around_box(const Eigen::Vector3d& min_mm, const Eigen::Vector3d& max_mm,
                     double spacing_mm);

}  // namespace usct
