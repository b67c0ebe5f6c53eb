// Vectors of unknown size cannot be members; NEON serves the machines that have SVE as well.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// Compiled once per instruction set; the best that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/patch_sums_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "similarity/patch_sums.h"
#include "similarity/sample_packed_ct-inl.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

// A machine of which Highway knows no vector instructions runs the reference.
#if HWY_TARGET == HWY_SCALAR
void sum_patches(const PatchSumsInput& in, PatchSums* sums) { sum_patches_scalar(in, sums); }
#else

/// The lanes of a patch's sums.
struct Lanes {
  VF inside, m, g, mm, gg, mg, um, ug;
};

template <GradientChannel kChannel>
HWY_INLINE void add_samples(const PatchSumsInput& in, const Constants& k, std::size_t s,
                            Lanes& sum) {
  hn::Mask<decltype(df)> inside;
  Sampled ct;
  if (!sample(k, hn::LoadU(df, in.x_mm + s), hn::LoadU(df, in.y_mm + s), hn::LoadU(df, in.z_mm + s),
              inside, ct))
    return;
  const VF value = hn::Sub(ct.value, hn::Set(df, k.background));
  VF gradient;
  if (kChannel == GradientChannel::kMagnitude) {
    gradient = magnitude(k, ct);
  } else {
    const VF zero = hn::Zero(df);
    const VF dx = hn::LoadU(df, in.us.direction_x.data() + s);
    const VF dy = hn::LoadU(df, in.us.direction_y.data() + s);
    const VF dz = hn::LoadU(df, in.us.direction_z.data() + s);
    gradient =
        hn::Abs(hn::MulAdd(ct.slope_i, turned(k.m[0], dx, dy, dz, zero),
                           hn::MulAdd(ct.slope_j, turned(k.m[1], dx, dy, dz, zero),
                                      hn::Mul(ct.slope_k, turned(k.m[2], dx, dy, dz, zero)))));
  }
  const VF m = hn::IfThenElseZero(inside, value);
  const VF g = hn::IfThenElseZero(inside, gradient);
  const VF u = hn::LoadU(df, in.us.value.data() + s);
  sum.inside = hn::Add(sum.inside, hn::IfThenElseZero(inside, hn::Set(df, 1.0F)));
  sum.m = hn::Add(sum.m, m);
  sum.g = hn::Add(sum.g, g);
  sum.mm = hn::MulAdd(m, m, sum.mm);
  sum.gg = hn::MulAdd(g, g, sum.gg);
  sum.mg = hn::MulAdd(m, g, sum.mg);
  sum.um = hn::MulAdd(u, m, sum.um);
  sum.ug = hn::MulAdd(u, g, sum.ug);
}

HWY_INLINE float total(VF lanes) { return hn::GetLane(hn::SumOfLanes(df, lanes)); }

template <GradientChannel kChannel>
void sum_all(const PatchSumsInput& in, PatchSums* sums) {
  const Constants constants(in.ct, in.T_index_us);
  const VF zero = hn::Zero(df);
  for (const UltrasoundPatches::Patch& patch : in.us.patches) {
    Lanes sum{zero, zero, zero, zero, zero, zero, zero, zero};
    const std::size_t end = patch.begin + patch.count;
    for (std::size_t s = patch.begin; s < end; s += hn::Lanes(df))
      add_samples<kChannel>(in, constants, s, sum);
    *sums++ = {total(sum.inside), total(sum.m),  total(sum.g),  total(sum.mm),
               total(sum.gg),     total(sum.mg), total(sum.um), total(sum.ug)};
  }
}

void sum_patches(const PatchSumsInput& in, PatchSums* sums) {
  if (in.channel == GradientChannel::kMagnitude)
    sum_all<GradientChannel::kMagnitude>(in, sums);
  else
    sum_all<GradientChannel::kAlongBeam>(in, sums);
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(sum_patches);

void sum_patches_simd(const PatchSumsInput& input, PatchSums* sums) {
  HWY_DYNAMIC_DISPATCH(sum_patches)(input, sums);
}

}  // namespace usct
#endif
