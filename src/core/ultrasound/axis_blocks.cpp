#include "ultrasound/axis_blocks.h"

#include <algorithm>

namespace usct {

int AxisBlocks::first(int block) const {
  return size == 1 ? block : std::clamp((block - 1) * size, 0, count);
}

void AxisBlocks::add(const float* values, float* sums) const {
  if (size == 1) {
    for (int i = 0; i < count; ++i) sums[i] += values[i];
    return;
  }
  for (int i = 0; i < count;) {
    float& block = sums[block_of(i)];
    float sum = block;
    for (const int end = std::min(count, i + size); i < end; ++i) sum += values[i];
    block = sum;
  }
}

void AxisBlocks::between(int i, int& block, float& share) const {
  if (size == 1) {
    block = i;
    share = 0.0F;
    return;
  }
  const double at = (i + 0.5) / size + 0.5;
  block = static_cast<int>(at);
  share = static_cast<float>(at - block);
}

}  // namespace usct
