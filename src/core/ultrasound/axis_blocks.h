#pragma once

namespace usct {

/// Blocks of samples, lines or frames along an axis. If their size is above 1, there is an empty
/// block beyond either end.
struct AxisBlocks {
  int count = 0;  // samples, lines or frames along the axis
  int size = 1;
  int blocks() const { return size == 1 ? count : (count + size - 1) / size + 2; }
  int block_of(int i) const { return size == 1 ? i : i / size + 1; }
  /// The first sample, line or frame of a block, or of the next one that has any.
  int first(int block) const;
  double middle(int block) const { return size == 1 ? block : (block - 0.5) * size - 0.5; }
  /// Adds a value for each sample, line or frame to the sum of its block.
  void add(const float* values, float* sums) const;
  /// Interpolation at i: the block whose middle is at or before i, and the weight of the next
  /// block.
  void between(int i, int& block, float& share) const;
};

}  // namespace usct
