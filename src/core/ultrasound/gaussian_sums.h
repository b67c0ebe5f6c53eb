#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "large_pages.h"
#include "ultrasound/axis_blocks.h"
#include "us_ct_registration/geometry/beam_grid.h"
#include "volume/combine_rows.h"

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
  /// Writes a line of each array that is summed: rows[array][sample].
  using Fill = std::function<void(int frame, int line, float* const* rows)>;
  /// Receives a line of the sums of each array. The rows are valid during the call only.
  using Use = std::function<void(int frame, int line, const float* const* rows)>;

  GaussianSums(const BeamGrid& beams, double sigma_mm);

  /// Sums several arrays together, which takes less time than one after the other. Both functions
  /// are called once per line, from several threads; all lines are filled before the first is used.
  void operator()(std::size_t arrays, const Fill& fill, const Use& use) const;

  /// Sums one array of samples x lines x frames.
  std::vector<float> operator()(const std::vector<float>& values) const;

 private:
  /// The rows (lines or frames) that enter each sum, with their weights, for one part of a row. The
  /// deeper a part lies, the farther are its rows apart, and the fewer are within the window.
  struct Taps {
    std::vector<RowRange> ranges;
    LargeVector<float> weights;  // aligned, unlike those of std::vector
  };
  class Table;

  template <typename PointAt>
  std::vector<Taps> taps_across(const AxisBlocks& rows, const PointAt& point_at) const;
  static void sum_across(const std::vector<Taps>& taps, std::size_t tables,
                         TableRows<const float> in, TableRows<float> out);
  Table sums_within_frames(std::size_t arrays, const Fill& fill) const;
  /// Writes the sums along the samples of a frame of blocks to a table for each array.
  void sum_along_samples(int frame_block, const Fill& fill, float* const* tables,
                         std::size_t arrays) const;
  /// `use` may write to the rows of the table that it receives the sums of.
  void sum_across_frames(const Table& table, const Use& use) const;
  void interpolate(const Table& table, const Use& use) const;

  double sigma_mm_;
  AxisBlocks samples_;
  AxisBlocks lines_;
  AxisBlocks frames_;
  std::size_t row_size_ = 0;     // blocks along samples, filled up to whole parts
  std::vector<float> kernel_;    // weights along samples, centred
  std::vector<Taps> line_taps_;  // for each part of a row
  std::vector<Taps> frame_taps_;
};

}  // namespace usct
