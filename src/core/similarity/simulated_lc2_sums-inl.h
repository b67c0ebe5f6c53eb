// Vectors of the kernel of simulated_lc2, and sums over the samples of a block. The kernel includes
// this file after hwy/foreach_target.h, once per instruction set; hence the guard that toggles.

#if defined(USCT_SIMULATED_LC2_SUMS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef USCT_SIMULATED_LC2_SUMS_INL_H_
#undef USCT_SIMULATED_LC2_SUMS_INL_H_
#else
#define USCT_SIMULATED_LC2_SUMS_INL_H_
#endif

#include <hwy/highway.h>

#include <cstdint>

#include "similarity/simulated_lc2_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace usct::simulated_lc2::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kLinesPerBlock>;
using DI = hn::RebindToSigned<D>;
#if HWY_TARGET == HWY_SCALAR
using DD = hn::Rebind<double, D>;
#else
using DD = hn::Repartition<double, D>;
#endif
using V = hn::Vec<D>;
using VI = hn::Vec<DI>;
using VD = hn::Vec<DD>;
using M = hn::Mask<D>;
constexpr D d;
constexpr DI di;

/// Samples of a beam in a run. A run is added up in single precision, whose error is then that of
/// one rounding or so and differs from sum to sum.
constexpr int kRun = 16;

/// The sum of a quantity over the samples of a block, lane by lane.
class Accumulator {
 public:
  // An implicit constructor would be compiled for another target.
  HWY_INLINE Accumulator() {}

  HWY_INLINE void add(V a) { few_ = hn::Add(few_, a); }
  HWY_INLINE void add_product(V a, V b) { few_ = hn::MulAdd(a, b, few_); }
  /// Goes on in double precision.
  HWY_INLINE void flush() {
    all_ = hn::Add(all_, hn::Add(lower(few_), upper(few_)));
    few_ = hn::Zero(d);
  }
  HWY_INLINE void add_to(double& sum) const { sum += hn::GetLane(hn::SumOfLanes(DD(), all_)); }

 private:
#if HWY_TARGET == HWY_SCALAR
  static HWY_INLINE VD lower(V v) { return hn::PromoteTo(DD(), v); }
  static HWY_INLINE VD upper(V) { return hn::Zero(DD()); }
#else
  static HWY_INLINE VD lower(V v) { return hn::PromoteTo(DD(), hn::LowerHalf(v)); }
  static HWY_INLINE VD upper(V v) { return hn::PromoteTo(DD(), hn::UpperHalf(hn::Half<D>(), v)); }
#endif

  V few_ = hn::Zero(d);
  VD all_ = hn::Zero(DD());
};

/// The sums of a block.
class Accumulators {
 public:
  HWY_INLINE Accumulators() {}

  /// Adds values, which must be 0 where they do not count.
  HWY_INLINE void add(V u, V p, V r) {
    u_.add(u);
    p_.add(p);
    r_.add(r);
    uu_.add_product(u, u);
    up_.add_product(u, p);
    ur_.add_product(u, r);
    pp_.add_product(p, p);
    pr_.add_product(p, r);
    rr_.add_product(r, r);
  }
  HWY_INLINE void add_occluded(V u) {
    u_occluded_.add(u);
    uu_occluded_.add_product(u, u);
  }
  HWY_INLINE void flush() {
    for (Accumulator* sum :
         {&u_, &p_, &r_, &uu_, &up_, &ur_, &pp_, &pr_, &rr_, &u_occluded_, &uu_occluded_})
      sum->flush();
  }
  HWY_INLINE void add_to(Sums& sums) const {
    u_.add_to(sums.u);
    p_.add_to(sums.p);
    r_.add_to(sums.r);
    uu_.add_to(sums.uu);
    up_.add_to(sums.up);
    ur_.add_to(sums.ur);
    pp_.add_to(sums.pp);
    pr_.add_to(sums.pr);
    rr_.add_to(sums.rr);
    u_occluded_.add_to(sums.u_occluded);
    uu_occluded_.add_to(sums.uu_occluded);
  }

 private:
  Accumulator u_, p_, r_, uu_, up_, ur_, pp_, pr_, rr_, u_occluded_, uu_occluded_;
};

}  // namespace
}  // namespace usct::simulated_lc2::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // guard that toggles
