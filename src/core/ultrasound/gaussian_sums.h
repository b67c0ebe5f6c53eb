#pragma once

#include <Eigen/Core>
#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"

namespace usct {

/// Sums under a Gaussian window in millimetres around each sample of a beam grid. Not normalised:
/// divide the sums of masked values by those of the mask.
///
/// Where the window is much wider than the spacing of samples, lines or frames, these are summed in
/// blocks, and results are interpolated trilinearly between the middles of the blocks. Blocks and
/// interpolation widen the window, which is narrowed by as much beforehand: its standard deviation
/// is right on average over a block, and within 8 % everywhere.
class GaussianSums {
 public:
  GaussianSums(const BeamGrid& beams, double sigma_mm);

  /// Samples x lines x frames values in and out. Moving the values in saves a copy.
  std::vector<float> operator()(std::vector<float> values) const;

 private:
  /// The blocks along an axis. Blocks of more than one entry have an empty block beyond either end.
  struct Blocks {
    int count = 0;  // of samples, lines or frames
    int size = 1;
    int blocks() const { return size == 1 ? count : (count + size - 1) / size + 2; }
    int block_of(int i) const { return size == 1 ? i : i / size + 1; }
    double middle(int block) const { return size == 1 ? block : (block - 0.5) * size - 0.5; }
    /// The block whose middle is at or before i, and the distance of i from it in blocks.
    void between(int i, int& block, float& share) const;
  };
  /// The weights with which a row (line, or frame) of blocks enters the sum of another, per sample.
  struct Tap {
    int row = 0;
    std::vector<float> weights;
  };
  using Taps = std::vector<std::vector<Tap>>;

  template <typename PointAt>
  Taps taps_across(const Blocks& rows, const PointAt& point_at) const;
  std::vector<float> block_sums(const std::vector<float>& values) const;
  /// Sums along samples and across lines, in place, of values or of blocks.
  void sum_within_frames(std::vector<float>& values) const;
  void sum_across_frames(std::vector<float>& values) const;
  /// Interpolates `values` between the sums of blocks.
  void interpolate(const std::vector<float>& sums, std::vector<float>& values) const;

  double sigma_mm_;
  Blocks samples_;
  Blocks lines_;
  Blocks frames_;
  std::vector<float> kernel_;  // the window along samples, symmetric
  Taps line_taps_;
  Taps frame_taps_;
};

}  // namespace usct
