#include "similarity/simulated_lc2_images.h"

#include <algorithm>
#include <cmath>

#include "require.h"

namespace usct::simulated_lc2 {

DifferencedCt::DifferencedCt(const CtVolume& ct, const std::optional<HuWindow>& window)
    : grid_(ct.grid), hu_(ct.voxels.begin(), ct.voxels.end()), voxels_(ct.voxels.size() + 1) {
  hu_.push_back(0);
  const CtVolume limited = window ? limited_to(*window, ct) : CtVolume{};
  const CtVolume& seen = window ? limited : ct;
  const auto [least, most] = std::minmax_element(seen.voxels.begin(), seen.voxels.end());
  // Differences need a unit of 2 HU only if CT values span more than 15 bits.
  unit_ = int{*most} - int{*least} > INT16_MAX ? 2 : 1;
  for (int k = 0; k < grid_.size.z(); ++k)
    for (int j = 0; j < grid_.size.y(); ++j)
      for (int i = 0; i < grid_.size.x(); ++i)
        voxels_[grid_.offset(i, j, k)] = packed(seen, {i, j, k});
}

void DifferencedCt::describe(Scene& scene) const {
  for (int axis = 0; axis < 3; ++axis) {
    scene.size[axis] = grid_.size[axis];
    scene.voxels_per_mm[axis] = static_cast<float>(1.0 / grid_.spacing_mm[axis]);
  }
  scene.voxels = voxels_.data();
  scene.hu = hu_.data();
  scene.difference_unit = static_cast<float>(unit_);
}

PackedVoxel DifferencedCt::packed(const CtVolume& ct, const Eigen::Vector3i& index) const {
  PackedVoxel voxel{ct.at(index.x(), index.y(), index.z()), {}};
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Vector3i ahead = index;
    Eigen::Vector3i behind = index;
    ahead[axis] = std::min(index[axis] + 1, grid_.size[axis] - 1);
    behind[axis] = std::max(index[axis] - 1, 0);
    const int difference = int{ct.at(ahead.x(), ahead.y(), ahead.z())} -
                           int{ct.at(behind.x(), behind.y(), behind.z())};
    voxel.difference[axis] = static_cast<std::int16_t>(difference / unit_);
  }
  return voxel;
}

BlockedUltrasound::BlockedUltrasound(const BeamUltrasound& ultrasound,
                                     const std::vector<std::uint8_t>& excluded)
    : samples_(ultrasound.beams.samples()),
      lines_(ultrasound.beams.lines),
      blocks_((lines_ + kLinesPerBlock - 1) / kLinesPerBlock),
      frames_(ultrasound.beams.frames) {
  const std::size_t count = ultrasound.brightness.size();
  require(excluded.empty() || excluded.size() == count, "excluded", "samples",
          static_cast<double>(excluded.size()), "none or as many as the ultrasound has");
  const auto counts = [&](std::size_t i) {
    return (excluded.empty() || excluded[i] == 0) &&
           (ultrasound.known.empty() || ultrasound.known[i] != 0);
  };
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i)
    if (counts(i)) {
      ++usable_;
      sum += ultrasound.brightness[i];
    }
  mean_ = usable_ > 0 ? static_cast<float>(sum / static_cast<double>(usable_)) : 0.0F;
  values_.assign(static_cast<std::size_t>(blocks()) * block_size(), std::nanf(""));
  samples_used_.assign(static_cast<std::size_t>(blocks()), 0);
  for (std::size_t i = 0; i < count; ++i)
    if (counts(i)) put(i, ultrasound.brightness[i] - mean_);
}

void BlockedUltrasound::describe(int block, Block& result) const {
  result.ultrasound = values_.data() + static_cast<std::size_t>(block) * block_size();
  result.samples = samples_used_[static_cast<std::size_t>(block)];
}

void BlockedUltrasound::put(std::size_t i, float value) {
  const auto samples = static_cast<std::size_t>(samples_);
  const auto lines = static_cast<std::size_t>(lines_);
  constexpr std::size_t kLines = kLinesPerBlock;
  const std::size_t sample = i % samples;
  const std::size_t line = i / samples % lines;
  const std::size_t frame = i / samples / lines;
  const std::size_t block = frame * static_cast<std::size_t>(blocks_) + line / kLines;
  values_[block * block_size() + sample * kLines + line % kLines] = value;
  samples_used_[block] = std::max(samples_used_[block], static_cast<int>(sample) + 1);
}

}  // namespace usct::simulated_lc2
