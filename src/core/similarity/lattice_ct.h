#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>

#include "large_pages.h"
#include "similarity/packed_ct.h"

namespace usct {

/// A block is a cube of so many points of a lattice along each edge.
constexpr int kBlockEdge = 4;
/// Rows are read and written by whole vectors of so many numbers. Arrays of rows have as many more
/// at their end.
constexpr std::size_t kBlockLanes = 16;
/// Arrays of a lattice have so many numbers more than points: the last point of a row may begin a
/// vector, and each word of a vector is made of those of the next neighbours too.
constexpr std::size_t kBeyondPoints = kBlockLanes + kBlockEdge - 1;

inline std::size_t whole_vectors(int count) {
  return (static_cast<std::size_t>(count) + kBlockLanes - 1) / kBlockLanes * kBlockLanes;
}

/// A CT at the points of a lattice, i fastest: (i, j, k) is at i + size.x() * (j + size.y() * k).
/// All arrays have kBeyondPoints numbers more than points.
struct LatticeCt {
  /// All points are undefined, until rows are sampled.
  explicit LatticeCt(const Eigen::Vector3i& points);

  Eigen::Vector3i size;
  /// CT value and magnitude of its gradient, in bytes of PackedCt: a point in the lowest byte of a
  /// word, its next neighbours along i in the other three; undefined where these do not lie within
  /// the lattice.
  LargeVector<std::uint32_t> value, gradient;
  /// The inverse of the covariance of both, with a ridge, over the cube of kBlockEdge^3 points that
  /// begins at a point; undefined where a cube does not lie within the lattice.
  LargeVector<float> inverse_vv, inverse_vg, inverse_gg;

  std::size_t place(const Eigen::Vector3i& at) const {
    return static_cast<std::size_t>(at.x()) +
           static_cast<std::size_t>(size.x()) *
               (static_cast<std::size_t>(at.y()) +
                static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(at.z()));
  }
  /// The byte of a point of `value` or `gradient`.
  static int byte(std::uint32_t word) { return static_cast<int>(word & 0xFFU); }
};

/// Variances that are added to those of value and gradient, in squares of their bytes.
struct Ridges {
  float value, gradient;
};

/// A covariance counts as no closer to singular than by this share of the product of the variances.
constexpr float kLeastDeterminant = 1e-3F;

/// Fills in the inverses.
void invert_covariances_scalar(LatticeCt& ct, const Ridges& ridges);
void invert_covariances_simd(LatticeCt& ct, const Ridges& ridges);

/// A row of points of a lattice in a CT.
struct LatticeRow {
  const std::uint32_t* words;  // PackedGradient::words
  Eigen::Array3f cells;        // of the CT along each axis
  int stride_j, stride_k;      // of the words
  float background;            // a byte of the CT
  Eigen::Array3f first, step;  // index in the CT of the first point, and from one to the next
};

/// Samples `count` points of a row, by trilinear interpolation of the bytes. Outside the CT there
/// is background without gradient. Writes what LatticeCt has, and up to kBlockLanes words more
/// that are undefined; reads words as far as kBeyondPoints beyond the row.
void sample_row_scalar(const LatticeRow& row, int count, std::uint32_t* value,
                       std::uint32_t* gradient);
void sample_row_simd(const LatticeRow& row, int count, std::uint32_t* value,
                     std::uint32_t* gradient);

/// The CT at a lattice, with inverse covariances; `T_index_lattice` leads from a point of the
/// lattice to the index in the CT. The ridges are standard deviations.
LatticeCt sampled_lattice(const PackedCt& ct, const Eigen::Affine3d& T_index_lattice,
                          const Eigen::Vector3i& size, double ridge_hu, double ridge_hu_per_mm);

}  // namespace usct
