#include <algorithm>
#include <cmath>
#include <limits>

#include "similarity/block_kernel.h"

namespace usct {

void block_values_scalar(const BlockMatch& match, std::uint8_t* values) {
  const LatticeCt& ct = match.ct;
  const std::size_t row = whole_vectors(match.translations.x());
  for (int z = 0; z < match.translations.z(); ++z)
    for (int y = 0; y < match.translations.y(); ++y, values += row)
      for (int x = 0; x < match.translations.x(); ++x) {
        const std::size_t first = match.place({x, y, z});
        const std::int8_t* ultrasound = match.ultrasound.cells.data();
        std::int32_t value = 0;
        std::int32_t gradient = 0;
        for (int k = 0; k < kBlockEdge; ++k)
          for (int j = 0; j < kBlockEdge; ++j)
            for (int i = 0; i < kBlockEdge; ++i, ++ultrasound) {
              const std::size_t at = first + ct.place({i, j, k});
              value += *ultrasound * LatticeCt::byte(ct.value[at]);
              gradient += *ultrasound * LatticeCt::byte(ct.gradient[at]);
            }
        const float v = static_cast<float>(value) / match.ultrasound.norm;
        const float g = static_cast<float>(gradient) / match.ultrasound.norm;
        const float explained = ct.inverse_vv[first] * v * v + 2.0F * ct.inverse_vg[first] * v * g +
                                ct.inverse_gg[first] * g * g;
        const float parts =
            std::min(kPartsOfCell * std::min(explained, match.ultrasound.known), 255.0F);
        values[x] = static_cast<std::uint8_t>(std::lround(parts));
      }
}

void add_blocks_scalar(const BlockSum& sum) {
  const std::size_t row = whole_vectors(sum.size.x());
  std::uint16_t* sums = sum.sums;
  for (int z = 0; z < sum.size.z(); ++z)
    for (int y = 0; y < sum.size.y(); ++y, sums += row)
      for (const BlockValues& block : sum.blocks) {
        const std::uint8_t* values = block.from({0, y, z}).first;
        constexpr int kMost = std::numeric_limits<std::uint16_t>::max();
        for (std::size_t x = 0; x < row; ++x)
          sums[x] = static_cast<std::uint16_t>(std::min(sums[x] + values[x], kMost));
      }
}

}  // namespace usct
