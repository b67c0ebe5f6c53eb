#pragma once

#include <cstddef>
#include <vector>

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

/// Values along a row that one call of `combine_tables` sums.
constexpr std::size_t kRowPart = 16;

/// Tables of rows of numbers that lie apart in memory.
template <typename T>
struct TableRows {
  T* const* tables;
  std::size_t row_stride;
};

/// Consecutive rows of a table, and where their weights begin: kRowPart for each.
struct RowRange {
  std::size_t first_row;
  std::size_t rows;
  std::size_t first_weight;
};

/// For each of `tables` tables, makes row n of `out` the sum of the rows ranges[n] of `in`, from
/// value `at` to at + kRowPart of the rows. A weight is loaded once for four tables.
void combine_tables(const std::vector<RowRange>& ranges, const float* weights, std::size_t at,
                    std::size_t tables, TableRows<const float> in, TableRows<float> out);

}  // namespace usct
