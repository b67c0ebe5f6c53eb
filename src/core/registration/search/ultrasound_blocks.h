#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <vector>

#include "similarity/block_kernel.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"

namespace usct::registration {

/// A cube of cells of the ultrasound.
struct UltrasoundBlock {
  Eigen::Vector3i first;         // its first cell
  Eigen::Vector3d middle_us_mm;  // of its known cells
  BlockUltrasound ultrasound;
};

/// The diagonal of the box along the axes of the US frame around all samples that count, mm; 0 if
/// none does.
double diagonal_mm(const BeamUltrasound& us);

/// Ultrasound averaged in the cells of a lattice along the axes of the US frame, and cut into
/// blocks.
class UltrasoundCells {
 public:
  /// Samples count where `known`. They lie where `mirror` moves them (see mirror_of). No cell
  /// between samples is known whose edge is shorter than the distance between them. Memory is taken
  /// for all cells of the box around the samples, so that its diagonal must be limited.
  UltrasoundCells(const BeamUltrasound& us, const Eigen::Isometry3d& mirror, double edge_mm);

  double edge_mm() const { return edge_mm_; }
  const Eigen::Vector3i& size() const { return size_; }
  /// The middle of a cell; cells beyond the lattice have one too.
  Eigen::Vector3d middle_us_mm(const Eigen::Vector3d& cell) const {
    return origin_us_mm_ + edge_mm_ * (cell + Eigen::Vector3d::Constant(0.5));
  }
  /// The number of cells with a sample that counts.
  std::size_t known() const;
  /// Blocks side by side, those of which half of the cells are known, and vary.
  std::vector<UltrasoundBlock> blocks() const;

 private:
  struct Cell {
    float sum = 0.0F;
    float count = 0.0F;
  };
  std::optional<UltrasoundBlock> block_at(const Eigen::Vector3i& first) const;
  std::size_t place(const Eigen::Vector3i& cell) const {
    return static_cast<std::size_t>(cell.x() + size_.x() * (cell.y() + size_.y() * cell.z()));
  }
  bool is_known(const Eigen::Vector3i& cell) const {
    return (cell.array() < size_.array()).all() && cells_[place(cell)].count > 0.0F;
  }

  double edge_mm_;
  Eigen::Vector3d origin_us_mm_ = Eigen::Vector3d::Zero();
  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();
  std::vector<Cell> cells_;
};

}  // namespace usct::registration
