#pragma once

#include <vector>

#include "us_ct_registration/geometry/beam_grid.h"

namespace usct {

/// Sums under a Gaussian window in millimetres around each sample of a beam grid. Not normalised:
/// divide the sums of masked values by those of the mask.
class GaussianSums {
 public:
  GaussianSums(const BeamGrid& beams, double sigma_mm);

  /// Samples x lines x frames in and out.
  std::vector<float> operator()(const std::vector<float>& values) const;

 private:
  /// Where the rows (lines, or frames) lie along a path across them, at each sample: mm.
  using Positions = std::vector<std::vector<float>>;

  std::vector<float> along_samples(const std::vector<float>& values) const;
  std::vector<float> across_lines(const std::vector<float>& values) const;
  std::vector<float> across_frames(const std::vector<float>& values) const;
  /// exp(-distance^2 / 2 sigma^2) per sample; false if it is 0 at all.
  bool weights(const Positions& positions, int from, int to, std::vector<float>& result) const;

  int samples_;
  int lines_;
  int frames_;
  float sigma_mm_;
  std::vector<float> kernel_;  // along samples: [0] is the centre
  Positions lines_mm_;
  Positions frames_mm_;
};

}  // namespace usct
