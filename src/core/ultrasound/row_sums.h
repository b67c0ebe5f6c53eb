#pragma once

#include <cstddef>

namespace usct {

struct WeightedRow {
  const float* weights;
  const float* values;
};

/// sums[i] = sum over the rows of weights[i] * values[i], for i in [0, count). By the widest vector
/// instructions of the processor; the same bits with any, for no product is fused.
void sum_rows(const WeightedRow* rows, std::size_t row_count, std::size_t count, float* sums);

}  // namespace usct
