#include <algorithm>
#include <cmath>

#include "similarity/patch_kernel.h"
#include "similarity/scalar_sampler.h"

namespace usct {

void sum_strands_scalar(const PatchKernelInput& in, std::size_t first, std::size_t last,
                        StrandSums* sums) {
  const ScalarSampler sampler(in);
  const auto background = static_cast<float>(in.ct.background());
  for (std::size_t b = first; b < last; ++b) {
    StrandSums sum{};
    const UltrasoundPatches::Block& block = in.us.blocks[b];
    for (std::size_t i = 0; i < block.rows * kLanes; ++i) {
      const std::size_t s = block.begin + i;
      const std::size_t lane = i % kLanes;
      ScalarSampler::Sampled ct;
      if (!sampler.sample(s, ct)) continue;
      const float m = ct.value - background;
      const float g = sampler.gradient(s, ct);
      const float u = in.us.value[s];
      sum.inside[lane] += 1.0F;
      sum.m[lane] += m;
      sum.g[lane] += g;
      sum.mm[lane] += m * m;
      sum.gg[lane] += g * g;
      sum.mg[lane] += m * g;
      sum.um[lane] += u * m;
      sum.ug[lane] += u * g;
    }
    *sums++ = sum;
  }
}

std::size_t sample_block_scalar(const PatchKernelInput& in, std::size_t block, float* values) {
  const ScalarSampler sampler(in);
  const std::size_t begin = in.us.blocks[block].begin;
  const std::size_t end = begin + in.us.blocks[block].rows * kLanes;
  std::size_t inside = 0;
  for (std::size_t s = begin; s < end; ++s) {
    ScalarSampler::Sampled ct;
    const bool is_inside = sampler.sample(s, ct);
    inside += is_inside ? 1 : 0;
    *values++ = is_inside ? ct.value : static_cast<float>(in.ct.background());
  }
  return inside;
}

Lc2Fit lc2_fit(const PatchMoments& sums, const Lc2Ridge& ridge) {
  const double per_sample = sums.count > 0.0 ? 1.0 / sums.count : 0.0;
  Lc2Fit fit;
  fit.mm = sums.mm - sums.m * sums.m * per_sample;
  fit.gg = sums.gg - sums.g * sums.g * per_sample;
  fit.mg = sums.mg - sums.m * sums.g * per_sample;
  fit.damped_mm = fit.mm + kLc2Floor * sums.mm + sums.count * ridge.intensity * ridge.intensity;
  fit.damped_gg = fit.gg + kLc2Floor * sums.gg + sums.count * ridge.gradient * ridge.gradient;
  const double determinant = fit.damped_mm * fit.damped_gg - fit.mg * fit.mg;
  fit.a = (fit.damped_gg * sums.um - fit.mg * sums.ug) / determinant;
  fit.b = (fit.damped_mm * sums.ug - fit.mg * sums.um) / determinant;
  fit.both = determinant > 0.0 && !(ridge.positive_gradient && fit.b < 0.0);
  if (!fit.both) {
    fit.a = fit.damped_mm > 0.0 ? sums.um / fit.damped_mm : 0.0;
    fit.b = 0.0;
  }
  return fit;
}

double explained_share(const PatchMoments& sums, const Lc2Ridge& ridge) {
  const Lc2Fit fit = lc2_fit(sums, ridge);
  const double explained =
      2.0 * (fit.a * sums.um + fit.b * sums.ug) -
      (fit.a * fit.a * fit.mm + 2.0 * fit.a * fit.b * fit.mg + fit.b * fit.b * fit.gg);
  return sums.uu > 0.0 ? std::clamp(explained / sums.uu, 0.0, 1.0) : 0.0;
}

void explained_shares_scalar(const StrandSums& sums, const double* count, const double* uu,
                             const Lc2Ridge& ridge, double* shares) {
  for (std::size_t i = 0; i < kLanes; ++i)
    shares[i] = explained_share({count[i], uu[i], sums.m[i], sums.g[i], sums.mm[i], sums.gg[i],
                                 sums.mg[i], sums.um[i], sums.ug[i]},
                                ridge);
}

}  // namespace usct
