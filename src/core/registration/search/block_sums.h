#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <vector>

#include "registration/search/ultrasound_blocks.h"
#include "similarity/block_kernel.h"
#include "similarity/packed_ct.h"

namespace usct::registration {

/// A motion of the field away from an orientation of the CT.
struct BlockPlace {
  std::size_t rotation = 0;                         // its index
  Eigen::Vector3i cells = Eigen::Vector3i::Zero();  // by which the blocks are moved then
  int explained = 0;  // the sum over the blocks of what block_values_scalar gives
};

/// Sums over the blocks of the ultrasound of what the CT explains of each, at rotations near one
/// orientation of the CT and at all translations. A rotation moves the blocks, and does not turn
/// them.
class BlockSums {
 public:
  /// Whether all blocks are summed everywhere, or a part that is spread over all of them at every
  /// other cell along y and z, where its blocks are moved by even numbers of cells, and all at and
  /// around the best optima of that.
  enum class Everywhere { kAll, kPart };

  /// `blocks` are those of `cells`, which must outlive the object; at least one. The rotations turn
  /// the field about the centre; translations reach so far along each axis, either way.
  BlockSums(const UltrasoundCells& cells, std::vector<UltrasoundBlock> blocks, Everywhere summed,
            std::vector<Eigen::Matrix3d> rotations, double translation_mm,
            const Eigen::Vector3d& centre_us_mm);

  /// The places that explain most, best first. `T_us_ct` is the orientation, at the initial
  /// translation.
  std::vector<BlockPlace> best(const PackedCt& ct, const Eigen::Isometry3d& T_us_ct) const;
  Eigen::Isometry3d T_us_ct_at(const BlockPlace& place, const Eigen::Isometry3d& T_us_ct) const;

 private:
  /// The offsets of a block in the lattice of the CT from where it lies in the ultrasound.
  struct Offsets {
    std::vector<Eigen::Vector3i> of_rotations;
    Eigen::Vector3i least;
    Eigen::Vector3i most;
  };
  /// Rounded to whole strides, of so many points.
  Offsets offsets_of(const UltrasoundBlock& block, const Eigen::Vector3i& stride) const;
  LatticeCt lattice(const PackedCt& ct, const Eigen::Isometry3d& T_us_ct) const;
  /// Values of blocks that are added to sums together.
  using Batch = std::array<std::vector<std::uint8_t>, kBlocksAdded>;
  /// The sums of the part of the blocks, for all translations at one rotation after the other.
  std::vector<int> sums_of_part(const LatticeCt& ct) const;
  void add(const LatticeCt& ct, std::size_t begin, std::size_t end, Batch& values,
           std::vector<std::uint16_t>& sums) const;
  /// The values of a block at so many translations, so far apart along y and z, the first of which
  /// leads so far from where it lies in the ultrasound.
  BlockValues write_values(const LatticeCt& ct, std::size_t block, const Eigen::Vector3i& first,
                           const Eigen::Vector3i& count, int stride,
                           std::vector<std::uint8_t>& values) const;
  std::size_t sums_per_rotation() const {
    return whole_vectors(sums_.x()) * static_cast<std::size_t>(sums_.y() * sums_.z());
  }
  void add_optima(const int* sums, std::size_t rotation, std::vector<BlockPlace>& optima) const;
  /// Sums all blocks at a place.
  void sum_all(const LatticeCt& ct, BlockPlace& place) const;
  /// Sums all blocks at a place and around it, and moves it to the highest sum.
  void climb(const LatticeCt& ct, BlockPlace& place) const;

  const UltrasoundCells& cells_;
  std::vector<UltrasoundBlock> blocks_;
  const Everywhere summed_;
  std::size_t part_;  // so many of them come first, spread over all
  std::vector<Eigen::Matrix3d> rotations_;
  Eigen::Vector3d centre_us_mm_;
  int reach_;                     // translations by so many cells along each axis, either way
  Eigen::Vector3i stride_;        // from one translation that is summed everywhere to the next
  Eigen::Vector3i sums_;          // numbers of these
  std::vector<Offsets> offsets_;  // of each block, by whole points
  std::vector<Offsets> strided_offsets_;  // of each block of the part, by whole strides
  Eigen::Vector3i margin_low_ = Eigen::Vector3i::Zero();
  Eigen::Vector3i margin_high_ = Eigen::Vector3i::Zero();
};

}  // namespace usct::registration
