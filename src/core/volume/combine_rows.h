#pragma once

#include <cstddef>

namespace usct {

/// out[i] = sum over t of weights[t] * rows[t][i], for i in [0, count). By the widest vector
/// instructions of the processor; the same bits with any, for no product is fused. Compiled for
/// the voxel types of the volumes.
template <typename T>
void combine_rows(const T* const* rows, const float* weights, std::size_t row_count,
                  std::size_t count, float* out);

}  // namespace usct
