// Sums of strands, for all lanes at once. The kernels include this file after
// hwy/foreach_target.h, once per instruction set; hence the guard that toggles.
#if defined(USCT_SIMILARITY_LANE_SUMS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef USCT_SIMILARITY_LANE_SUMS_INL_H_
#undef USCT_SIMILARITY_LANE_SUMS_INL_H_
#else
#define USCT_SIMILARITY_LANE_SUMS_INL_H_
#endif

#include "similarity/sample_packed_ct-inl.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

#if HWY_TARGET != HWY_SCALAR

/// StrandSums of the strands of one vector.
struct LaneSums {
  VF inside, m, g, mm, gg, mg, um, ug;
};

HWY_INLINE LaneSums no_sums() {
  const VF zero = hn::Zero(df);
  return {zero, zero, zero, zero, zero, zero, zero, zero};
}

/// Adds a sample of each strand; `inside` is 1 in the CT, else 0.
HWY_INLINE void add(LaneSums& sum, VF inside, VF m, VF g, VF u) {
  sum.inside = hn::Add(sum.inside, inside);
  sum.m = hn::Add(sum.m, m);
  sum.g = hn::Add(sum.g, g);
  sum.mm = hn::MulAdd(m, m, sum.mm);
  sum.gg = hn::MulAdd(g, g, sum.gg);
  sum.mg = hn::MulAdd(m, g, sum.mg);
  sum.um = hn::MulAdd(u, m, sum.um);
  sum.ug = hn::MulAdd(u, g, sum.ug);
}

HWY_INLINE void store(const LaneSums& from, StrandSums& sums, std::size_t lane) {
  hn::StoreU(from.inside, df, sums.inside + lane);
  hn::StoreU(from.m, df, sums.m + lane);
  hn::StoreU(from.g, df, sums.g + lane);
  hn::StoreU(from.mm, df, sums.mm + lane);
  hn::StoreU(from.gg, df, sums.gg + lane);
  hn::StoreU(from.mg, df, sums.mg + lane);
  hn::StoreU(from.um, df, sums.um + lane);
  hn::StoreU(from.ug, df, sums.ug + lane);
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
