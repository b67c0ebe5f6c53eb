#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

/// The inner loops of the matching of blocks. The scalar version is the reference; the vector
/// version is held to it by tests.
namespace usct {

/// A block is a cube of so many cells along each edge.
constexpr int kBlockEdge = 4;
/// Rows of translations are as long as a multiple of this, so that no vector is cut. Arrays that
/// are read by rows have as many floats more at their end.
constexpr std::size_t kBlockLanes = 8;

inline std::size_t whole_vectors(int count) {
  return (static_cast<std::size_t>(count) + kBlockLanes - 1) / kBlockLanes * kBlockLanes;
}

/// A CT at the points of a lattice, i fastest: (i, j, k) is at i + size.x() * (j + size.y() * k).
/// All arrays have kBlockLanes floats more than points.
struct LatticeCt {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  /// CT value and magnitude of its gradient.
  std::vector<float> value, gradient;
  /// The inverse of the covariance of both, with a ridge, over the cube of kBlockEdge^3 points that
  /// begins at a point; undefined where a cube does not lie within the lattice.
  std::vector<float> inverse_vv, inverse_vg, inverse_gg;

  std::size_t place(const Eigen::Vector3i& at) const {
    return static_cast<std::size_t>(at.x()) +
           static_cast<std::size_t>(size.x()) *
               (static_cast<std::size_t>(at.y()) +
                static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(at.z()));
  }
  /// Fills in the inverses. The ridges are variances, in the squared units of value and gradient.
  void invert_covariances(float value_ridge, float gradient_ridge);
};

/// A block of ultrasound at a lattice of translations of the CT.
struct BlockMatch {
  const LatticeCt& ct;
  /// The point of the lattice at which the block begins at the first translation.
  Eigen::Vector3i first;
  /// Numbers of translations, by one point each.
  Eigen::Vector3i translations;
  /// The ultrasound of the block's cells, x fastest: mean 0 and norm 1 over the known ones, 0 at
  /// the others.
  const float* ultrasound;
  /// The number of known cells.
  float known;
};

/// For each translation the share of the block's variance that a linear function of CT value and
/// gradient explains (LC2, Wein 2013, with a ridge), times the number of its known cells.
/// `values` has rows along x of whole_vectors(translations.x()); what follows the translations of a
/// row is undefined.
void block_values_scalar(const BlockMatch& match, float* values);
void block_values_simd(const BlockMatch& match, float* values);

/// Part of the rows of `values`, and sums of the same for all blocks at one motion.
struct BlockSum {
  const float* values;        // the first value to add
  std::size_t row, slice;     // from one row, or slice, of `values` to the next
  Eigen::Vector3i sums_size;  // rows of `sums` are whole_vectors(sums_size.x()) long
  float* sums;
};

/// Adds the values to the sums.
void add_block_scalar(const BlockSum& sum);
void add_block_simd(const BlockSum& sum);

}  // namespace usct
