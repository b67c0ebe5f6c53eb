#pragma once

#include <cstddef>

namespace usct {

/// Weighted sums of rows of numbers, by the widest vector instructions of the processor. Each sum
/// adds the rows in their order, so that its bits depend neither on the count nor on the width of
/// the vectors. Processors with fused multiply-add round once per row, others twice. `out` must not
/// overlap the rows.

/// out[i] = sum over r of weights[r] * rows[r][i], for i in [0, count). Compiled for the voxel
/// types of the volumes.
template <typename T>
void combine_rows(const T* const* rows, const float* weights, std::size_t row_count,
                  std::size_t count, float* out);

/// A row with a weight for each of its values.
struct WeightedRow {
  const float* weights;
  const float* values;
};

/// out[i] = sum over r of rows[r].weights[i] * rows[r].values[i], for i in [0, count).
void combine_rows(const WeightedRow* rows, std::size_t row_count, std::size_t count, float* out);

}  // namespace usct
