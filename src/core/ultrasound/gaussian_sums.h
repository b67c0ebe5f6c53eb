#pragma once

#include <Eigen/Core>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"

namespace usct {

/// Sums under a Gaussian window in millimetres around each sample of a beam grid. Not normalised:
/// divide the sums of masked values by those of the mask.
///
/// Windows much wider than the spacing of samples, lines or frames are summed over blocks of them,
/// and interpolated trilinearly between the blocks' middles; they are narrowed by what the blocks
/// and the interpolation widen them. The standard deviation of the window is so kept on the average
/// over a block, and within it to 8 %, at worst.
class GaussianSums {
 public:
  GaussianSums(const BeamGrid& beams, double sigma_mm);

  /// Samples x lines x frames in and out; in place of those that are moved in.
  std::vector<float> operator()(std::vector<float> values) const;

 private:
  /// The blocks along an axis. If they are larger than 1 there is an empty one beyond either end.
  struct Blocks {
    int count = 0;  // of what is summed
    int size = 1;
    int blocks() const { return size == 1 ? count : (count + size - 1) / size + 2; }
    int block_of(int i) const { return size == 1 ? i : i / size + 1; }
    double middle(int block) const { return size == 1 ? block : (block - 0.5) * size - 0.5; }
    /// The block whose middle is at or before i, and how far i is to the next.
    void between(int i, int& block, float& share) const;
  };
  /// What a row (line, or frame) of blocks adds to another, sample by sample.
  struct Tap {
    int row = 0;
    std::vector<float> weights;
  };
  using Taps = std::vector<std::vector<Tap>>;

  template <typename PointAt>
  Taps taps_across(const Blocks& rows, const PointAt& point_at) const;
  std::vector<float> block_sums(const std::vector<float>& values) const;
  /// Along samples and across lines; of values or blocks, in their place.
  void sum_within_frames(std::vector<float>& values) const;
  void sum_across_frames(std::vector<float>& values) const;
  /// Between the sums of blocks.
  void interpolate(const std::vector<float>& sums, std::vector<float>& values) const;

  double sigma_mm_;
  Blocks samples_;
  Blocks lines_;
  Blocks frames_;
  std::vector<float> kernel_;  // along samples, to either side of its middle
  Taps line_taps_;
  Taps frame_taps_;
};

}  // namespace usct
