#include "registration/search/block_sums.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "registration/motion_about.h"

namespace usct::registration {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3i;

/// The ridges of value and gradient, as standard deviations.
constexpr double kRidgeHu = 5.0;
constexpr double kRidgeHuPerMm = 1.5;

/// So many optima of a part of the blocks are summed over all blocks, and so many of these also at
/// the translations around them.
constexpr std::size_t kMostOptima = 64;
constexpr std::size_t kMostClimbed = 8;
constexpr int kAround = 1;

/// Orders blocks so that the first of them are spread over all, however many are taken: those with
/// even places along all axes come first, and of these again the even ones of the even ones.
/// Returns the size of the part that is summed everywhere.
std::size_t spread(std::vector<UltrasoundBlock>& blocks) {
  constexpr std::size_t kPart = 300;
  const auto rank = [](const UltrasoundBlock& block) {
    constexpr int kBits = 10;
    std::uint32_t bits = 0;
    for (int bit = 0; bit < kBits; ++bit)
      for (const int first : block.first)
        bits = bits << 1U | (static_cast<std::uint32_t>(first / kBlockEdge) >> bit & 1U);
    return bits;
  };
  std::stable_sort(
      blocks.begin(), blocks.end(),
      [&](const UltrasoundBlock& a, const UltrasoundBlock& b) { return rank(a) < rank(b); });
  return std::min(kPart, blocks.size());
}

void keep_best(std::vector<BlockPlace>& places, std::size_t most) {
  const auto rank = [](const BlockPlace& place) {
    return std::make_tuple(-place.explained, place.rotation, place.cells.z(), place.cells.y(),
                           place.cells.x());
  };
  most = std::min(most, places.size());
  std::partial_sort(places.begin(), places.begin() + static_cast<std::ptrdiff_t>(most),
                    places.end(),
                    [&](const BlockPlace& a, const BlockPlace& b) { return rank(a) < rank(b); });
  places.resize(most);
}

}  // namespace

BlockSums::BlockSums(const UltrasoundCells& cells, std::vector<UltrasoundBlock> blocks,
                     Everywhere summed, std::vector<Matrix3d> rotations, double translation_mm,
                     const Vector3d& centre_us_mm)
    : cells_(cells),
      blocks_(std::move(blocks)),
      summed_(summed),
      part_(summed == Everywhere::kAll ? blocks_.size() : spread(blocks_)),
      rotations_(std::move(rotations)),
      centre_us_mm_(centre_us_mm),
      // A translation lies up to half a cell from one of whole cells.
      reach_(static_cast<int>(std::ceil(translation_mm / cells.edge_mm() - 0.5))),
      stride_(summed == Everywhere::kAll ? Vector3i(1, 1, 1) : Vector3i(1, 2, 2)),
      sums_((Vector3i::Constant(2 * reach_).array() / stride_.array() + 1).matrix()) {
  for (const UltrasoundBlock& block : blocks_)
    offsets_.push_back(offsets_of(block, Vector3i::Ones()));
  for (std::size_t block = 0; block < part_; ++block)
    strided_offsets_.push_back(offsets_of(blocks_[block], stride_));
  for (const std::vector<Offsets>* all : {&offsets_, &strided_offsets_})
    for (const Offsets& offsets : *all) {
      margin_low_ = margin_low_.cwiseMax(-offsets.least);
      margin_high_ = margin_high_.cwiseMax(offsets.most);
    }
  // The last block of an axis may begin in the last cell.
  margin_low_.array() += reach_ + kAround;
  margin_high_.array() += reach_ + kAround + kBlockEdge;
}

BlockSums::Offsets BlockSums::offsets_of(const UltrasoundBlock& block,
                                         const Vector3i& stride) const {
  Offsets offsets;
  const Vector3d stride_mm = cells_.edge_mm() * stride.cast<double>();
  const Vector3d from_centre = block.middle_us_mm - centre_us_mm_;
  for (const Matrix3d& rotation : rotations_) {
    const Vector3d moved = rotation.transpose() * from_centre - from_centre;
    const Vector3i strides = moved.cwiseQuotient(stride_mm).array().round().cast<int>();
    offsets.of_rotations.push_back(stride.cwiseProduct(strides));
  }
  offsets.least = offsets.most = offsets.of_rotations.front();
  for (const Vector3i& offset : offsets.of_rotations) {
    offsets.least = offsets.least.cwiseMin(offset);
    offsets.most = offsets.most.cwiseMax(offset);
  }
  return offsets;
}

LatticeCt BlockSums::lattice(const PackedCt& ct, const Isometry3d& T_us_ct) const {
  const Isometry3d T_ct_us = T_us_ct.inverse();
  const auto index = [&](const Vector3d& point) {
    const Vector3d cell = point - margin_low_.cast<double>();
    return ct.grid().index_from_physical(T_ct_us * cells_.middle_us_mm(cell));
  };
  Eigen::Affine3d T_index_lattice = Eigen::Affine3d::Identity();
  T_index_lattice.translation() = index(Vector3d::Zero());
  for (int axis = 0; axis < 3; ++axis)
    T_index_lattice.linear().col(axis) =
        index(Vector3d::Unit(axis)) - T_index_lattice.translation();
  return sampled_lattice(ct, T_index_lattice, cells_.size() + margin_low_ + margin_high_, kRidgeHu,
                         kRidgeHuPerMm);
}

BlockValues BlockSums::write_values(const LatticeCt& ct, std::size_t block, const Vector3i& first,
                                    const Vector3i& count, int stride,
                                    std::vector<std::uint8_t>& values) const {
  const UltrasoundBlock& of = blocks_[block];
  const std::size_t row = whole_vectors(count.x());
  const std::size_t slice = row * static_cast<std::size_t>(count.y());
  values.resize(slice * static_cast<std::size_t>(count.z()) + kBlockLanes);
  block_values_simd({ct, of.first + margin_low_ + first, count, stride, of.ultrasound},
                    values.data());
  return {values.data(), row, slice};
}

void BlockSums::add(const LatticeCt& ct, std::size_t begin, std::size_t end, Batch& values,
                    std::vector<std::uint16_t>& sums) const {
  const std::vector<std::uint8_t> zeros(whole_vectors(sums_.x()));
  std::array<BlockValues, kBlocksAdded> written;
  written.fill({zeros.data(), 0, 0});
  for (std::size_t block = begin; block < end; ++block) {
    const Offsets& offsets = strided_offsets_[block];
    const Vector3i width = offsets.most - offsets.least;
    written[block - begin] =
        write_values(ct, block, offsets.least - Vector3i::Constant(reach_),
                     width.cwiseQuotient(stride_) + sums_, stride_.z(), values[block - begin]);
  }
  for (std::size_t r = 0; r < rotations_.size(); ++r) {
    BlockSum sum{written, sums_, &sums[r * sums_per_rotation()]};
    for (std::size_t block = begin; block < end; ++block) {
      const Offsets& offsets = strided_offsets_[block];
      BlockValues& of_block = sum.blocks[block - begin];
      const Vector3i from_least = offsets.of_rotations[r] - offsets.least;
      of_block = of_block.from(from_least.cwiseQuotient(stride_));
    }
    add_blocks_simd(sum);
  }
}

std::vector<int> BlockSums::sums_of_part(const LatticeCt& ct) const {
  // So many blocks, of at most 255 each, stay within the 16 bits of their sums.
  constexpr std::size_t kMostBlocks = 256;
  static_assert(kMostBlocks % kBlocksAdded == 0);
  std::vector<int> totals(rotations_.size() * sums_per_rotation());
  std::vector<std::uint16_t> sums(totals.size());
  Batch values;
  for (std::size_t begin = 0; begin < part_; begin += kMostBlocks) {
    const std::size_t end = std::min(begin + kMostBlocks, part_);
    std::fill(sums.begin(), sums.end(), std::uint16_t{0});
    for (std::size_t block = begin; block < end; block += kBlocksAdded)
      add(ct, block, std::min(block + kBlocksAdded, end), values, sums);
    for (std::size_t i = 0; i < totals.size(); ++i) totals[i] += sums[i];
  }
  return totals;
}

void BlockSums::add_optima(const int* sums, std::size_t rotation,
                           std::vector<BlockPlace>& optima) const {
  const auto row = static_cast<std::ptrdiff_t>(whole_vectors(sums_.x()));
  const std::ptrdiff_t slice = row * sums_.y();
  for (int z = 0; z < sums_.z(); ++z)
    for (int y = 0; y < sums_.y(); ++y)
      for (int x = 0; x < sums_.x(); ++x) {
        const int* here = sums + z * slice + y * row + x;
        const auto falls = [&](int i, int count, std::ptrdiff_t step) {
          return (i == 0 || here[-step] <= *here) && (i + 1 == count || here[step] < *here);
        };
        if (!falls(x, sums_.x(), 1) || !falls(y, sums_.y(), row) || !falls(z, sums_.z(), slice))
          continue;
        const Vector3i cells = stride_.cwiseProduct(Vector3i(x, y, z));
        optima.push_back({rotation, cells - Vector3i::Constant(reach_), *here});
      }
}

void BlockSums::sum_all(const LatticeCt& ct, BlockPlace& place) const {
  std::vector<std::uint8_t> values;
  place.explained = 0;
  for (std::size_t block = 0; block < blocks_.size(); ++block) {
    write_values(ct, block, offsets_[block].of_rotations[place.rotation] + place.cells,
                 Vector3i::Ones(), 1, values);
    place.explained += values.front();
  }
}

void BlockSums::climb(const LatticeCt& ct, BlockPlace& place) const {
  const Vector3i edges = Vector3i::Constant(2 * kAround + 1);
  const Vector3i first = place.cells - Vector3i::Constant(kAround);
  std::vector<std::uint8_t> values;
  std::vector<int> sums(whole_vectors(edges.x()) * static_cast<std::size_t>(edges.y() * edges.z()));
  BlockValues written;
  for (std::size_t block = 0; block < blocks_.size(); ++block) {
    written = write_values(ct, block, offsets_[block].of_rotations[place.rotation] + first, edges,
                           1, values);
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += values[i];
  }
  place.explained = 0;
  for (int z = 0; z < edges.z(); ++z)
    for (int y = 0; y < edges.y(); ++y)
      for (int x = 0; x < edges.x(); ++x) {
        const auto at = static_cast<std::size_t>(written.from({x, y, z}).first - values.data());
        if (sums[at] > place.explained)
          place = {place.rotation, first + Vector3i(x, y, z), sums[at]};
      }
}

std::vector<BlockPlace> BlockSums::best(const PackedCt& ct, const Isometry3d& T_us_ct) const {
  const LatticeCt lattice = this->lattice(ct, T_us_ct);
  const std::vector<int> sums = sums_of_part(lattice);
  std::vector<BlockPlace> places;
  for (std::size_t r = 0; r < rotations_.size(); ++r)
    add_optima(sums.data() + r * sums_per_rotation(), r, places);
  keep_best(places, kMostOptima);
  if (summed_ == Everywhere::kAll) return places;
  for (BlockPlace& place : places) sum_all(lattice, place);
  keep_best(places, kMostClimbed);
  for (BlockPlace& place : places) climb(lattice, place);
  keep_best(places, kMostClimbed);
  return places;
}

Isometry3d BlockSums::T_us_ct_at(const BlockPlace& place, const Isometry3d& T_us_ct) const {
  // The CT is read so many cells away from where the block lies.
  const Vector3d away_mm = cells_.edge_mm() * place.cells.cast<double>();
  return motion_about(centre_us_mm_, rotations_[place.rotation]) * Eigen::Translation3d(-away_mm) *
         T_us_ct;
}

}  // namespace usct::registration
