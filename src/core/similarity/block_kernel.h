#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "similarity/lattice_ct.h"

/// The inner loops of the matching of blocks. The scalar versions are the reference; the vector
/// versions are held to them by tests.
namespace usct {

constexpr int kBlockCells = kBlockEdge * kBlockEdge * kBlockEdge;

/// Cells of a block have at most so much, either way. Products of bytes are added two by two along
/// an edge, and those of a slice of the block then stay within 16 bits.
constexpr int kMostOfCell = 15;
static_assert(kBlockEdge * kBlockEdge / 2 * 255 * kMostOfCell <=
              std::numeric_limits<std::int16_t>::max());

/// The ultrasound of a block's cells, x fastest.
struct BlockUltrasound {
  std::array<std::int8_t, kBlockCells>
      cells{};         // their sum is 0; 0 where the ultrasound is unknown
  float norm = 0.0F;   // the root of the sum of their squares
  float known = 0.0F;  // the number of known cells
};

/// A block of ultrasound at a lattice of translations of the CT.
struct BlockMatch {
  const LatticeCt& ct;
  /// The point of the lattice at which the block begins at the first translation.
  Eigen::Vector3i first;
  /// Numbers of translations. They are one point apart along x, and so many along y and z.
  Eigen::Vector3i translations;
  int stride;
  const BlockUltrasound& ultrasound;

  /// The point of the lattice at which the block begins then.
  std::size_t place(const Eigen::Vector3i& translation) const {
    return ct.place(first + Eigen::Vector3i(translation.x(), stride * translation.y(),
                                            stride * translation.z()));
  }
};

/// Values count in parts of a cell, and end at 255 of these.
constexpr float kPartsOfCell = 4.0F;

/// For each translation the share of the block's variance that a linear function of CT value and
/// gradient explains (LC2, Wein 2013, with a ridge), times the number of its known cells.
/// `values` has rows along x of whole_vectors(translations.x()); what follows the translations of a
/// row is undefined.
void block_values_scalar(const BlockMatch& match, std::uint8_t* values);
void block_values_simd(const BlockMatch& match, std::uint8_t* values);

/// Part of the rows of a block's values.
struct BlockValues {
  const std::uint8_t* first = nullptr;
  std::size_t row = 0;    // from one row to the next
  std::size_t slice = 0;  // and from one slice to the next

  /// The part that begins so many values later.
  BlockValues from(const Eigen::Vector3i& at) const {
    return {first + static_cast<std::size_t>(at.x()) + static_cast<std::size_t>(at.y()) * row +
                static_cast<std::size_t>(at.z()) * slice,
            row, slice};
  }
};

/// So many blocks are added at once, which spares loading and storing the sums for each.
constexpr std::size_t kBlocksAdded = 4;

/// Values of blocks, and sums of the same for all blocks at one motion.
struct BlockSum {
  std::array<BlockValues, kBlocksAdded> blocks;
  Eigen::Vector3i size;  // of the sums, whose rows are whole_vectors(size.x()) long
  std::uint16_t* sums;
};

/// Adds the values to the sums, which end at the largest number that they can be.
void add_blocks_scalar(const BlockSum& sum);
void add_blocks_simd(const BlockSum& sum);

}  // namespace usct
