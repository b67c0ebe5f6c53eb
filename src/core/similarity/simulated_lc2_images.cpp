#include "similarity/simulated_lc2_images.h"

#include <algorithm>
#include <cmath>

namespace usct::simulated_lc2 {

DifferencedCt::DifferencedCt(const CtVolume& ct, const std::optional<HuWindow>& window)
    : grid_(ct.grid), voxels_(ct.voxels.size() + 1) {
  if (window) {
    hu_.assign(ct.voxels.begin(), ct.voxels.end());
    hu_.push_back(0);
  }
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
  constexpr int kValuesOfVoxel = sizeof(PackedVoxel) / sizeof(std::int16_t);
  scene.hu = hu_.empty() ? &voxels_.front().hu : hu_.data();
  scene.hu_step = hu_.empty() ? kValuesOfVoxel : 1;
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

BlockedUltrasound::BlockedUltrasound(const BeamUltrasound& ultrasound)
    : samples_(ultrasound.beams.samples()) {
  const std::size_t count = ultrasound.brightness.size();
  std::vector<std::uint8_t> counts(count);
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i)
    if (ultrasound.known.empty() || ultrasound.known[i] != 0) {
      counts[i] = 1;
      ++usable_;
      sum += ultrasound.brightness[i];
    }
  mean_ = usable_ > 0 ? static_cast<float>(sum / static_cast<double>(usable_)) : 0.0F;
  place_blocks(ultrasound.beams, counts);
  values_.assign(static_cast<std::size_t>(blocks()) * block_size(), std::nanf(""));
  for (int block = 0; block < blocks(); ++block) fill(block, ultrasound, counts);
}

void BlockedUltrasound::describe(int block, Block& result) const {
  const Place& place = places_[static_cast<std::size_t>(block)];
  result.ultrasound = values_.data() + static_cast<std::size_t>(block) * block_size();
  result.samples = place.end_used;
  result.first_used = place.first_used;
}

void BlockedUltrasound::place_blocks(const BeamGrid& beams,
                                     const std::vector<std::uint8_t>& counts) {
  for (int frame = 0; frame < beams.frames; ++frame) {
    const auto is_used = [&](int line) {
      const std::uint8_t* first = counts.data() + beams.offset(frame, line);
      return std::find(first, first + samples_, 1) != first + samples_;
    };
    int begin = 0;
    int end = beams.lines;
    while (begin < end && !is_used(begin)) ++begin;
    while (end > begin && !is_used(end - 1)) --end;
    for (int line = begin; line < end; line += kLinesPerBlock)
      places_.push_back({frame, line, samples_, 0});
  }
}

void BlockedUltrasound::fill(int block, const BeamUltrasound& ultrasound,
                             const std::vector<std::uint8_t>& counts) {
  const BeamGrid& beams = ultrasound.beams;
  Place& place = places_[static_cast<std::size_t>(block)];
  float* values = values_.data() + static_cast<std::size_t>(block) * block_size();
  const int lines = std::min(kLinesPerBlock, beams.lines - place.first_line);
  for (int lane = 0; lane < lines; ++lane) {
    std::size_t i = beams.offset(place.frame, place.first_line + lane);
    for (int sample = 0; sample < samples_; ++sample, ++i) {
      if (counts[i] == 0) continue;
      values[sample * kLinesPerBlock + lane] = ultrasound.brightness[i] - mean_;
      place.first_used = std::min(place.first_used, sample);
      place.end_used = std::max(place.end_used, sample + 1);
    }
  }
}

}  // namespace usct::simulated_lc2
