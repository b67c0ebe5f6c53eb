#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "similarity/large_pages.h"
#include "similarity/simulated_lc2_kernel.h"
#include "us_ct_registration/ultrasound/beam_ultrasound.h"
#include "us_ct_registration/volume/hu_window.h"
#include "us_ct_registration/volume/volume.h"

/// The two images as the kernel of SimulatedLc2 reads them.
namespace usct::simulated_lc2 {

/// The CT, where each voxel is stored with the differences of its neighbours.
class DifferencedCt {
 public:
  DifferencedCt(const CtVolume& ct, const std::optional<HuWindow>& window);

  const Grid& grid() const { return grid_; }
  void describe(Scene& scene) const;

 private:
  PackedVoxel packed(const CtVolume& ct, const Eigen::Vector3i& index) const;

  Grid grid_;
  LargeVector<std::int16_t> hu_;
  LargeVector<PackedVoxel> voxels_;
  int unit_ = 1;
};

/// Ultrasound in blocks of neighbouring lines, minus its mean.
class BlockedUltrasound {
 public:
  /// Throws InputError unless `excluded` is empty or has an entry for each sample.
  BlockedUltrasound(const BeamUltrasound& ultrasound, const std::vector<std::uint8_t>& excluded);

  int blocks() const { return frames_ * blocks_; }
  int frame(int block) const { return block / blocks_; }
  int first_line(int block) const { return block % blocks_ * kLinesPerBlock; }
  std::size_t usable() const { return usable_; }
  double mean() const { return mean_; }

  /// Leaves out samples behind the last that counts.
  void describe(int block, Block& result) const;

 private:
  std::size_t block_size() const {
    return static_cast<std::size_t>(samples_) * std::size_t{kLinesPerBlock};
  }
  void put(std::size_t i, float value);

  int samples_, lines_, blocks_, frames_;
  std::size_t usable_ = 0;
  float mean_ = 0.0F;
  LargeVector<float> values_;
  std::vector<int> samples_used_;  // per block
};

}  // namespace usct::simulated_lc2
