#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "large_pages.h"
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
  LargeVector<std::int16_t> hu_;  // as recorded, if the voxels have those of a window
  LargeVector<PackedVoxel> voxels_;
  int unit_ = 1;
};

/// Ultrasound in blocks of neighbouring lines, minus its mean. Lines without a sample that counts
/// at either end of a frame, as scan-converted ultrasound has them, are in no block.
class BlockedUltrasound {
 public:
  explicit BlockedUltrasound(const BeamUltrasound& ultrasound);

  int blocks() const { return static_cast<int>(places_.size()); }
  int frame(int block) const { return places_[static_cast<std::size_t>(block)].frame; }
  int first_line(int block) const { return places_[static_cast<std::size_t>(block)].first_line; }
  std::size_t usable() const { return usable_; }
  double mean() const { return mean_; }

  /// Leaves out samples behind the last that counts, and says which is the first.
  void describe(int block, Block& result) const;

 private:
  /// A block lies at these lines of this frame. Its samples that count begin at `first_used` and
  /// end before `end_used`.
  struct Place {
    int frame, first_line;
    int first_used, end_used;
  };

  std::size_t block_size() const {
    return static_cast<std::size_t>(samples_) * std::size_t{kLinesPerBlock};
  }
  /// `counts` has an entry for each sample.
  void place_blocks(const BeamGrid& beams, const std::vector<std::uint8_t>& counts);
  void fill(int block, const BeamUltrasound& ultrasound, const std::vector<std::uint8_t>& counts);

  int samples_;
  std::size_t usable_ = 0;
  float mean_ = 0.0F;
  std::vector<Place> places_;
  LargeVector<float> values_;
};

}  // namespace usct::simulated_lc2
