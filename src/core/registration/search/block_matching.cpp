#include "registration/search/block_matching.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"
#include "registration/search/ultrasound_blocks.h"
#include "registration/search/unpacked_ct.h"
#include "similarity/block_kernel.h"
#include "us_ct_registration/geometry/angles.h"

namespace usct::registration {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3i;

/// Blocks are compared at orientations that lie so far from each other at most, and summed at
/// motions in between that lie so far from each other at most.
constexpr double kOrientationRad = 25.0 * kDegree;
constexpr double kMotionRad = 6.3 * kDegree;
/// More orientations along each axis, or translations farther than this, take longer and more
/// memory than what they find is worth.
constexpr int kMostParts = 4;
constexpr double kMostMm = 40.0;
/// The ridges of value and gradient, as standard deviations.
constexpr float kRidgeHu = 10.0F;
constexpr float kRidgeHuPerMm = 3.0F;

/// Rotation vectors in the middles of count^3 equal parts of a cube around 0.
std::vector<Vector3d> middles_of_parts(double half_width, int count) {
  const double width = 2.0 * half_width / count;
  const auto middle = [&](int i) { return -half_width + (i + 0.5) * width; };
  std::vector<Vector3d> middles;
  for (int x = 0; x < count; ++x)
    for (int y = 0; y < count; ++y)
      for (int z = 0; z < count; ++z) middles.emplace_back(middle(x), middle(y), middle(z));
  return middles;
}

int parts_of(double width, double most) {
  return std::max(1, static_cast<int>(std::ceil(width / most)));
}

Matrix3d rotation(const Vector3d& vector) {
  const double angle = vector.norm();
  if (!(angle > 0.0)) return Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

/// The motion by a rotation about a centre.
Isometry3d about(const Vector3d& centre, const Matrix3d& linear) {
  Isometry3d motion = Isometry3d::Identity();
  motion.linear() = linear;
  motion.translation() = centre - linear * centre;
  return motion;
}

/// Blocks, the motions at which they are summed, and where each block lies then.
class Matching {
 public:
  Matching(const UltrasoundCells& cells, std::vector<UltrasoundBlock> blocks,
           const StartOptions& region, const Vector3d& centre_us_mm);

  /// Optima among the translations, at the motions about one orientation.
  std::vector<Candidate> optima(const UnpackedCt& ct, const Isometry3d& T_us_ct) const;

 private:
  /// The offsets of a block in the lattice of the CT from where it lies in the ultrasound.
  struct Offsets {
    std::vector<Vector3i> of_motions;
    Vector3i least;
    Vector3i most;
  };
  Offsets offsets_of(const UltrasoundBlock& block) const;
  LatticeCt lattice(const UnpackedCt& ct, const Isometry3d& T_us_ct) const;
  /// The sums of the blocks, for all translations at one motion after the other.
  std::vector<float> sums(const LatticeCt& ct) const;
  void add(const LatticeCt& ct, std::size_t block, std::vector<float>& values,
           std::vector<float>& sums) const;
  std::size_t sums_per_motion() const {
    return whole_vectors(translations_) * static_cast<std::size_t>(translations_ * translations_);
  }
  void add_optima(const float* sums, const Isometry3d& T_us_ct, const Matrix3d& motion,
                  std::vector<Candidate>& optima) const;

  const UltrasoundCells& cells_;
  const std::vector<UltrasoundBlock> blocks_;
  const Vector3d centre_us_mm_;
  int reach_;         // translations by so many cells along each axis, either way
  int translations_;  // in all along each axis
  std::vector<Matrix3d> motions_;
  std::vector<Offsets> offsets_;  // of each block
  Vector3i margin_low_ = Vector3i::Zero();
  Vector3i margin_high_ = Vector3i::Zero();
};

Matching::Matching(const UltrasoundCells& cells, std::vector<UltrasoundBlock> blocks,
                   const StartOptions& region, const Vector3d& centre_us_mm)
    : cells_(cells),
      blocks_(std::move(blocks)),
      centre_us_mm_(centre_us_mm),
      reach_(static_cast<int>(std::ceil(region.translation_mm / UltrasoundCells::kMm))),
      translations_(2 * reach_ + 1) {
  const double width =
      2.0 * region.rotation_rad / parts_of(2.0 * region.rotation_rad, kOrientationRad);
  for (const Vector3d& motion : middles_of_parts(0.5 * width, parts_of(width, kMotionRad)))
    motions_.push_back(rotation(motion));
  for (const UltrasoundBlock& block : blocks_) {
    offsets_.push_back(offsets_of(block));
    margin_low_ = margin_low_.cwiseMax(-offsets_.back().least);
    margin_high_ = margin_high_.cwiseMax(offsets_.back().most);
  }
  // The last block of an axis may begin in the last cell.
  margin_low_.array() += reach_;
  margin_high_.array() += reach_ + kBlockEdge;
}

Matching::Offsets Matching::offsets_of(const UltrasoundBlock& block) const {
  Offsets offsets;
  const Vector3d from_centre = block.middle_us_mm - centre_us_mm_;
  for (const Matrix3d& motion : motions_) {
    const Vector3d moved = motion.transpose() * from_centre - from_centre;
    offsets.of_motions.push_back((moved / UltrasoundCells::kMm).array().round().cast<int>());
  }
  offsets.least = offsets.most = offsets.of_motions.front();
  for (const Vector3i& offset : offsets.of_motions) {
    offsets.least = offsets.least.cwiseMin(offset);
    offsets.most = offsets.most.cwiseMax(offset);
  }
  return offsets;
}

LatticeCt Matching::lattice(const UnpackedCt& ct, const Isometry3d& T_us_ct) const {
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

void Matching::add(const LatticeCt& ct, std::size_t block, std::vector<float>& values,
                   std::vector<float>& sums) const {
  const Offsets& offsets = offsets_[block];
  const UltrasoundBlock& of = blocks_[block];
  const Vector3i first = of.first + margin_low_ + offsets.least - Vector3i::Constant(reach_);
  const Vector3i count = offsets.most - offsets.least + Vector3i::Constant(translations_);
  const std::size_t row = whole_vectors(count.x());
  const std::size_t slice = row * static_cast<std::size_t>(count.y());
  values.resize(slice * static_cast<std::size_t>(count.z()) + kBlockLanes);
  block_values_simd({ct, first, count, of.ultrasound.data(), of.known}, values.data());
  for (std::size_t m = 0; m < motions_.size(); ++m) {
    const Vector3i at = offsets.of_motions[m] - offsets.least;
    add_block_simd(
        {values.data() + static_cast<std::size_t>(at.x()) + static_cast<std::size_t>(at.y()) * row +
             static_cast<std::size_t>(at.z()) * slice,
         row, slice, Vector3i::Constant(translations_), sums.data() + m * sums_per_motion()});
  }
}

std::vector<float> Matching::sums(const LatticeCt& ct) const {
  std::vector<float> sums(motions_.size() * sums_per_motion());
  std::vector<float> values;
  for (std::size_t block = 0; block < blocks_.size(); ++block) add(ct, block, values, sums);
  return sums;
}

void Matching::add_optima(const float* sums, const Isometry3d& T_us_ct, const Matrix3d& motion,
                          std::vector<Candidate>& optima) const {
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
        // The CT is read so many cells away from where the block lies.
        const Vector3d away_mm =
            UltrasoundCells::kMm * (Vector3d(x, y, z) - Vector3d::Constant(reach_));
        const Isometry3d T =
            about(centre_us_mm_, motion) * Eigen::Translation3d(-away_mm) * T_us_ct;
        optima.push_back({T, {}, static_cast<double>(*here), 0.0});
      }
}

std::vector<Candidate> Matching::optima(const UnpackedCt& ct, const Isometry3d& T_us_ct) const {
  constexpr std::size_t kMostPerOrientation = 256;
  const std::vector<float> sums = this->sums(lattice(ct, T_us_ct));
  std::vector<Candidate> optima;
  for (std::size_t m = 0; m < motions_.size(); ++m)
    add_optima(sums.data() + m * sums_per_motion(), T_us_ct, motions_[m], optima);
  sort_best_first(optima, kMostPerOrientation);
  return optima;
}

}  // namespace

bool BlockMatching::covers(const StartOptions& region) {
  return region.translation_mm <= kMostMm &&
         parts_of(2.0 * region.rotation_rad, kOrientationRad) <= kMostParts;
}

std::vector<Candidate> BlockMatching::poses(const Isometry3d& T_us_ct_initial,
                                            const StartOptions& region, const Isometry3d& mirror,
                                            const FieldPoints& field, double distinct_mm,
                                            std::size_t most, Run& run) const {
  const int parts = parts_of(2.0 * region.rotation_rad, kOrientationRad);
  const UltrasoundCells cells(*us_, mirror);
  std::vector<UltrasoundBlock> blocks = cells.blocks();
  if (blocks.empty()) return {};
  const Vector3d& centre = field.centre_us_mm();
  const Matching matching(cells, std::move(blocks), region, centre);
  const UnpackedCt ct(*ct_);
  const std::vector<Vector3d> orientations = middles_of_parts(region.rotation_rad, parts);
  std::vector<std::vector<Candidate>> found(orientations.size());
  parallel_for(static_cast<int>(orientations.size()), [&](int i) {
    run.check_cancelled();
    const auto at = static_cast<std::size_t>(i);
    found[at] = matching.optima(ct, about(centre, rotation(orientations[at])) * T_us_ct_initial);
  });
  std::vector<Candidate> all;
  for (const std::vector<Candidate>& of_orientation : found)
    all.insert(all.end(), of_orientation.begin(), of_orientation.end());
  return best_distinct(std::move(all), distinct_mm, most, field);
}

}  // namespace usct::registration
