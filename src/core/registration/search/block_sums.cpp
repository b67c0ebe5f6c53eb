#include "registration/search/block_sums.h"

#include <algorithm>
#include <cmath>

#include "registration/motion_about.h"

namespace usct::registration {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3i;

/// The ridges of value and gradient, as standard deviations.
constexpr float kRidgeHu = 10.0F;
constexpr float kRidgeHuPerMm = 3.0F;

/// So many optima of a part of the blocks are summed over all blocks, and so many of these also at
/// the translations around them.
constexpr std::size_t kMostOptima = 64;
constexpr std::size_t kMostClimbed = 8;
constexpr int kAround = 1;

/// Moves a quarter or half of the blocks to the front that is spread over all, or leaves them as
/// they are. Returns their number. Fewer blocks than this do not tell optima from noise.
std::size_t spread_part(std::vector<UltrasoundBlock>& blocks) {
  constexpr std::ptrdiff_t kLeast = 150;
  const auto is_odd = [](const UltrasoundBlock& block, int axis) {
    return block.first[axis] / kBlockEdge % 2 != 0;
  };
  const auto is_of_quarter = [&](const UltrasoundBlock& block) {
    return is_odd(block, 0) == is_odd(block, 1) && is_odd(block, 1) == is_odd(block, 2);
  };
  const auto is_of_half = [&](const UltrasoundBlock& block) {
    return (is_odd(block, 0) != is_odd(block, 1)) == is_odd(block, 2);
  };
  const auto moved_to_front = [&](const auto& is_of_part) {
    if (std::count_if(blocks.begin(), blocks.end(), is_of_part) < kLeast) return blocks.begin();
    return std::stable_partition(blocks.begin(), blocks.end(), is_of_part);
  };
  auto end = moved_to_front(is_of_quarter);
  if (end == blocks.begin()) end = moved_to_front(is_of_half);
  if (end == blocks.begin()) end = blocks.end();
  return static_cast<std::size_t>(end - blocks.begin());
}

void keep_best(std::vector<BlockPlace>& places, std::size_t most) {
  std::stable_sort(places.begin(), places.end(), [](const BlockPlace& a, const BlockPlace& b) {
    return a.explained > b.explained;
  });
  if (places.size() > most) places.resize(most);
}

}  // namespace

BlockSums::BlockSums(const UltrasoundCells& cells, std::vector<UltrasoundBlock> blocks,
                     std::vector<Matrix3d> rotations, double translation_mm,
                     const Vector3d& centre_us_mm)
    : cells_(cells),
      blocks_(std::move(blocks)),
      part_(spread_part(blocks_)),
      rotations_(std::move(rotations)),
      centre_us_mm_(centre_us_mm),
      reach_(static_cast<int>(std::ceil(translation_mm / UltrasoundCells::kMm))),
      translations_(2 * reach_ + 1) {
  for (const UltrasoundBlock& block : blocks_) {
    offsets_.push_back(offsets_of(block));
    margin_low_ = margin_low_.cwiseMax(-offsets_.back().least);
    margin_high_ = margin_high_.cwiseMax(offsets_.back().most);
  }
  // The last block of an axis may begin in the last cell.
  margin_low_.array() += reach_ + kAround;
  margin_high_.array() += reach_ + kAround + kBlockEdge;
}

BlockSums::Offsets BlockSums::offsets_of(const UltrasoundBlock& block) const {
  Offsets offsets;
  const Vector3d from_centre = block.middle_us_mm - centre_us_mm_;
  for (const Matrix3d& rotation : rotations_) {
    const Vector3d moved = rotation.transpose() * from_centre - from_centre;
    offsets.of_rotations.push_back((moved / UltrasoundCells::kMm).array().round().cast<int>());
  }
  offsets.least = offsets.most = offsets.of_rotations.front();
  for (const Vector3i& offset : offsets.of_rotations) {
    offsets.least = offsets.least.cwiseMin(offset);
    offsets.most = offsets.most.cwiseMax(offset);
  }
  return offsets;
}

LatticeCt BlockSums::lattice(const CtSampler& ct, const Isometry3d& T_us_ct) const {
  LatticeCt lattice;
  lattice.size = cells_.size() + margin_low_ + margin_high_;
  const std::size_t count = static_cast<std::size_t>(lattice.size.prod()) + kBlockLanes;
  lattice.value.resize(count);
  lattice.gradient.resize(count);
  const Isometry3d T_ct_us = T_us_ct.inverse();
  const auto index = [&](const Vector3d& cell) {
    return ct.grid().index_from_physical(T_ct_us *
                                         cells_.middle_us_mm(cell - margin_low_.cast<double>()));
  };
  const Vector3d step = index(Vector3d::UnitX()) - index(Vector3d::Zero());
  for (int k = 0; k < lattice.size.z(); ++k)
    for (int j = 0; j < lattice.size.y(); ++j) {
      const std::size_t begin = lattice.place({0, j, k});
      ct.sample(index(Vector3d(0.0, j, k)), step, static_cast<std::size_t>(lattice.size.x()),
                &lattice.value[begin], &lattice.gradient[begin]);
    }
  lattice.invert_covariances(kRidgeHu * kRidgeHu, kRidgeHuPerMm * kRidgeHuPerMm);
  return lattice;
}

void BlockSums::add(const LatticeCt& ct, std::size_t block, std::vector<float>& values,
                    std::vector<float>& sums) const {
  const Offsets& offsets = offsets_[block];
  const UltrasoundBlock& of = blocks_[block];
  const Vector3i first = of.first + margin_low_ + offsets.least - Vector3i::Constant(reach_);
  const Vector3i count = offsets.most - offsets.least + Vector3i::Constant(translations_);
  const std::size_t row = whole_vectors(count.x());
  const std::size_t slice = row * static_cast<std::size_t>(count.y());
  values.resize(slice * static_cast<std::size_t>(count.z()) + kBlockLanes);
  block_values_simd({ct, first, count, of.ultrasound.data(), of.known}, values.data());
  for (std::size_t r = 0; r < rotations_.size(); ++r) {
    const Vector3i at = offsets.of_rotations[r] - offsets.least;
    add_block_simd(
        {values.data() + static_cast<std::size_t>(at.x()) + static_cast<std::size_t>(at.y()) * row +
             static_cast<std::size_t>(at.z()) * slice,
         row, slice, Vector3i::Constant(translations_), sums.data() + r * sums_per_rotation()});
  }
}

std::vector<float> BlockSums::sums_of_part(const LatticeCt& ct) const {
  std::vector<float> sums(rotations_.size() * sums_per_rotation());
  std::vector<float> values;
  for (std::size_t block = 0; block < part_; ++block) add(ct, block, values, sums);
  return sums;
}

void BlockSums::add_optima(const float* sums, std::size_t rotation,
                           std::vector<BlockPlace>& optima) const {
  const auto row = static_cast<std::ptrdiff_t>(whole_vectors(translations_));
  const std::ptrdiff_t slice = row * translations_;
  for (int z = 0; z < translations_; ++z)
    for (int y = 0; y < translations_; ++y)
      for (int x = 0; x < translations_; ++x) {
        const float* here = sums + z * slice + y * row + x;
        const auto falls = [&](int i, std::ptrdiff_t step) {
          return (i == 0 || here[-step] <= *here) && (i + 1 == translations_ || here[step] < *here);
        };
        if (!falls(x, 1) || !falls(y, row) || !falls(z, slice)) continue;
        optima.push_back({rotation, Vector3i(x, y, z) - Vector3i::Constant(reach_), *here});
      }
}

void BlockSums::climb(const LatticeCt& ct, int around, BlockPlace& place) const {
  const int edge = 2 * around + 1;
  const std::size_t row = whole_vectors(edge);
  const std::size_t slice = row * static_cast<std::size_t>(edge);
  std::vector<float> values(slice * static_cast<std::size_t>(edge) + kBlockLanes);
  std::vector<float> sums(values.size());
  const Vector3i moved = place.cells + margin_low_ - Vector3i::Constant(around);
  for (std::size_t block = 0; block < blocks_.size(); ++block) {
    const UltrasoundBlock& of = blocks_[block];
    block_values_simd({ct, of.first + offsets_[block].of_rotations[place.rotation] + moved,
                       Vector3i::Constant(edge), of.ultrasound.data(), of.known},
                      values.data());
    add_block_simd({values.data(), row, slice, Vector3i::Constant(edge), sums.data()});
  }
  BlockPlace best = place;
  best.explained = 0.0F;
  for (int z = 0; z < edge; ++z)
    for (int y = 0; y < edge; ++y)
      for (int x = 0; x < edge; ++x) {
        const float sum = sums[static_cast<std::size_t>(x) + static_cast<std::size_t>(y) * row +
                               static_cast<std::size_t>(z) * slice];
        if (sum > best.explained)
          best = {place.rotation, place.cells + Vector3i(x, y, z) - Vector3i::Constant(around),
                  sum};
      }
  place = best;
}

std::vector<BlockPlace> BlockSums::best(const CtSampler& ct, const Isometry3d& T_us_ct) const {
  const LatticeCt lattice = this->lattice(ct, T_us_ct);
  const std::vector<float> sums = sums_of_part(lattice);
  std::vector<BlockPlace> places;
  for (std::size_t r = 0; r < rotations_.size(); ++r)
    add_optima(sums.data() + r * sums_per_rotation(), r, places);
  keep_best(places, kMostOptima);
  if (part_ == blocks_.size()) return places;
  for (BlockPlace& place : places) climb(lattice, 0, place);
  keep_best(places, kMostClimbed);
  for (BlockPlace& place : places) climb(lattice, kAround, place);
  keep_best(places, kMostClimbed);
  return places;
}

Isometry3d BlockSums::T_us_ct_at(const BlockPlace& place, const Isometry3d& T_us_ct) const {
  // The CT is read so many cells away from where the block lies.
  const Vector3d away_mm = UltrasoundCells::kMm * place.cells.cast<double>();
  return motion_about(centre_us_mm_, rotations_[place.rotation]) * Eigen::Translation3d(-away_mm) *
         T_us_ct;
}

}  // namespace usct::registration
