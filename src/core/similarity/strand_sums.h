#pragma once

#include <algorithm>
#include <array>

#include "similarity/backend.h"
#include "similarity/packed_ct.h"
#include "us_ct_registration/similarity/lc2_options.h"

/// Conversion of sums over strands to sums over patches, or over all samples.
namespace usct {

/// Number of blocks that are summed before their sums are used; these fit the first-level cache.
constexpr std::size_t kBlocksAtOnce = 32;

/// Calls use(block, sums) for the blocks [first, last), in order.
template <typename Use>
void for_blocks(const SimilarityBackend& backend, const PatchKernelInput& input, std::size_t first,
                std::size_t last, const Use& use) {
  std::array<StrandSums, kBlocksAtOnce> sums;
  for (std::size_t begin = first; begin < last; begin += kBlocksAtOnce) {
    const std::size_t end = std::min(last, begin + kBlocksAtOnce);
    backend.sum_strands(input, begin, end, sums.data());
    for (std::size_t b = begin; b < end; ++b) use(b, sums[b - begin]);
  }
}

/// Adds the sums of a strand except those of the ultrasound alone; `mean` is added to its values u.
inline void add_strand(const StrandSums& sums, std::size_t lane, double mean,
                       PatchMoments& moments) {
  const double m = sums.m[lane];
  const double g = sums.g[lane];
  moments.m += m;
  moments.g += g;
  moments.mm += sums.mm[lane];
  moments.gg += sums.gg[lane];
  moments.mg += sums.mg[lane];
  moments.um += sums.um[lane] + mean * m;
  moments.ug += sums.ug[lane] + mean * g;
}

inline double sum_of_lanes(const float* lanes) {
  double sum = 0.0;
  for (std::size_t i = 0; i < kLanes; ++i) sum += static_cast<double>(lanes[i]);
  return sum;
}

/// The ridge on the scale of the packed CT's bytes.
inline Lc2Ridge ridge_of(const Lc2Options& options, const PackedCt& ct) {
  return {options.ridge_intensity_hu / ct.step_hu(),
          options.ridge_gradient_hu_per_mm / ct.step_hu(), options.positive_gradient};
}

}  // namespace usct
