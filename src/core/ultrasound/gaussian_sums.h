#pragma once

#include <Eigen/Core>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"

namespace usct {

/// Sums under a Gaussian window in millimetres around each sample of a beam grid. The sums are not
/// normalised: divide the sums of masked values by the sums of the mask.
///
/// If the window is much wider than the spacing of samples, lines or frames, these are first summed
/// over blocks, the window is applied to the blocks, and the result is interpolated trilinearly
/// between the middles of the blocks. Blocks and interpolation widen the window, so a narrower one
/// is applied. Its standard deviation is then right on average over a block, and at most 8 % off
/// within one.
class GaussianSums {
 public:
  GaussianSums(const BeamGrid& beams, double sigma_mm);

  /// Takes and returns samples x lines x frames. A vector that is moved in is reused for the
  /// result.
  std::vector<float> operator()(std::vector<float> values) const;

 private:
  /// The blocks along an axis. If their size is above 1, there is an empty block beyond either end.
  struct Blocks {
    int count = 0;  // samples, lines or frames along the axis
    int size = 1;
    int blocks() const { return size == 1 ? count : (count + size - 1) / size + 2; }
    int block_of(int i) const { return size == 1 ? i : i / size + 1; }
    double middle(int block) const { return size == 1 ? block : (block - 0.5) * size - 0.5; }
    /// Interpolation at i: the block whose middle is at or before i, and the weight of the next
    /// block.
    void between(int i, int& block, float& share) const;
  };
  /// The weights with which a row (line or frame) of blocks enters the sum of another row, one per
  /// sample.
  struct Tap {
    int row = 0;
    std::vector<float> weights;
  };
  using Taps = std::vector<std::vector<Tap>>;

  template <typename PointAt>
  Taps taps_across(const Blocks& rows, const PointAt& point_at) const;
  std::vector<float> block_sums(const std::vector<float>& values) const;
  /// Applies the window along samples and across lines, in place, to values or to sums of blocks.
  void sum_within_frames(std::vector<float>& values) const;
  void sum_across_frames(std::vector<float>& values) const;
  /// Interpolates between the sums of blocks.
  void interpolate(const std::vector<float>& sums, std::vector<float>& values) const;

  double sigma_mm_;
  Blocks samples_;
  Blocks lines_;
  Blocks frames_;
  std::vector<float> kernel_;  // weights along samples, centred
  Taps line_taps_;
  Taps frame_taps_;
};

}  // namespace usct
