// Vectors of unknown size cannot be members; NEON serves the machines that have SVE as well.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// Compiled once per instruction set; the best that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/patch_sums_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "similarity/patch_sums.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

// A machine of which Highway knows no vector instructions runs the reference.
#if HWY_TARGET == HWY_SCALAR
void sum_patches(const PatchSumsInput& in, PatchSums* sums) { sum_patches_scalar(in, sums); }
#else

namespace hn = hwy::HWY_NAMESPACE;

const hn::ScalableTag<float> df;
const hn::RebindToSigned<decltype(df)> di;
const hn::RebindToUnsigned<decltype(df)> du;
const hn::Half<decltype(di)> di_half;
const hn::RepartitionToWide<decltype(di)> di64;
const hn::RepartitionToWide<decltype(du)> du64;
using VF = hn::Vec<decltype(df)>;
using VU = hn::Vec<decltype(du)>;

/// What stays the same for all samples. Vectors cannot be members on every target.
struct Constants {
  explicit Constants(const PatchSumsInput& in) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) m[r][c] = static_cast<float>(in.T_index_us.linear()(r, c));
      origin[r] = static_cast<float>(in.T_index_us.translation()[r]);
      cells[r] = static_cast<float>(in.ct.grid().size[r] - 1);
      per_mm[r] = static_cast<float>(1.0 / in.ct.grid().spacing_mm[r]);
    }
    stride_j = static_cast<std::int32_t>(in.ct.cell_stride_j());
    stride_k = static_cast<std::int32_t>(in.ct.cell_stride_k());
    background = static_cast<float>(in.ct.background());
  }
  float m[3][3];
  float origin[3];
  float cells[3];
  float per_mm[3];
  std::int32_t stride_j, stride_k;
  float background;
};

HWY_INLINE VF turned(const float* row, VF x, VF y, VF z, VF plus) {
  return hn::MulAdd(hn::Set(df, row[0]), x,
                    hn::MulAdd(hn::Set(df, row[1]), y, hn::MulAdd(hn::Set(df, row[2]), z, plus)));
}

HWY_INLINE VF lerp(VF a, VF b, VF t) { return hn::MulAdd(t, hn::Sub(b, a), a); }

template <int kByte>
HWY_INLINE VF byte_of(VU word) {
  const VU shifted = hn::ShiftRight<8 * kByte>(word);
  const VU byte = kByte == 3 ? shifted : hn::And(shifted, hn::Set(du, 0xFFU));
  return hn::ConvertTo(df, hn::BitCast(di, byte));
}

/// The lanes of a patch's sums.
struct Lanes {
  VF inside, m, g, mm, gg, mg, um, ug;
};

template <GradientChannel kChannel>
HWY_INLINE void add_samples(const PatchSumsInput& in, const Constants& k, std::size_t s,
                            Lanes& sum) {
  const VF zero = hn::Zero(df);
  const VF px = hn::LoadU(df, in.x_mm + s);
  const VF py = hn::LoadU(df, in.y_mm + s);
  const VF pz = hn::LoadU(df, in.z_mm + s);
  const VF x = turned(k.m[0], px, py, pz, hn::Set(df, k.origin[0]));
  const VF y = turned(k.m[1], px, py, pz, hn::Set(df, k.origin[1]));
  const VF z = turned(k.m[2], px, py, pz, hn::Set(df, k.origin[2]));
  const auto inside = hn::And(hn::And(hn::And(hn::Ge(x, zero), hn::Lt(x, hn::Set(df, k.cells[0]))),
                                      hn::And(hn::Ge(y, zero), hn::Lt(y, hn::Set(df, k.cells[1])))),
                              hn::And(hn::Ge(z, zero), hn::Lt(z, hn::Set(df, k.cells[2]))));
  if (hn::AllFalse(df, inside)) return;

  // Truncation is floor: what is inside is not negative.
  const auto i = hn::ConvertTo(di, hn::IfThenElseZero(inside, x));
  const auto j = hn::ConvertTo(di, hn::IfThenElseZero(inside, y));
  const auto l = hn::ConvertTo(di, hn::IfThenElseZero(inside, z));
  const auto cell =
      hn::Add(hn::Add(i, hn::Mul(j, hn::Set(di, k.stride_j))), hn::Mul(l, hn::Set(di, k.stride_k)));
  const auto* words = in.ct.cells().data();
  const auto first =
      hn::GatherIndex(du64, words, hn::PromoteTo(di64, hn::LowerHalf(di_half, cell)));
  const auto second =
      hn::GatherIndex(du64, words, hn::PromoteTo(di64, hn::UpperHalf(di_half, cell)));
  const VU low = hn::ConcatEven(du, hn::BitCast(du, second), hn::BitCast(du, first));
  const VU high = hn::ConcatOdd(du, hn::BitCast(du, second), hn::BitCast(du, first));

  const VF ti = hn::Sub(x, hn::ConvertTo(df, i));
  const VF tj = hn::Sub(y, hn::ConvertTo(df, j));
  const VF tk = hn::Sub(z, hn::ConvertTo(df, l));
  const VF c000 = byte_of<0>(low);
  const VF c010 = byte_of<2>(low);
  const VF c001 = byte_of<0>(high);
  const VF c011 = byte_of<2>(high);
  // Slopes along i on the four edges, then bilinearly between them.
  const VF s00 = hn::Sub(byte_of<1>(low), c000);
  const VF s10 = hn::Sub(byte_of<3>(low), c010);
  const VF s01 = hn::Sub(byte_of<1>(high), c001);
  const VF s11 = hn::Sub(byte_of<3>(high), c011);
  const VF e00 = hn::MulAdd(ti, s00, c000);
  const VF e10 = hn::MulAdd(ti, s10, c010);
  const VF e01 = hn::MulAdd(ti, s01, c001);
  const VF e11 = hn::MulAdd(ti, s11, c011);
  const VF slope_j0 = hn::Sub(e10, e00);
  const VF slope_j1 = hn::Sub(e11, e01);
  const VF face0 = hn::MulAdd(tj, slope_j0, e00);
  const VF face1 = hn::MulAdd(tj, slope_j1, e01);
  const VF gi = lerp(lerp(s00, s10, tj), lerp(s01, s11, tj), tk);
  const VF gj = lerp(slope_j0, slope_j1, tk);
  const VF gk = hn::Sub(face1, face0);

  const VF value = hn::Sub(hn::MulAdd(tk, gk, face0), hn::Set(df, k.background));
  VF gradient;
  if (kChannel == GradientChannel::kMagnitude) {
    const VF gx = hn::Mul(gi, hn::Set(df, k.per_mm[0]));
    const VF gy = hn::Mul(gj, hn::Set(df, k.per_mm[1]));
    const VF gz = hn::Mul(gk, hn::Set(df, k.per_mm[2]));
    gradient = hn::Sqrt(hn::MulAdd(gx, gx, hn::MulAdd(gy, gy, hn::Mul(gz, gz))));
  } else {
    const VF dx = hn::LoadU(df, in.us.direction_x.data() + s);
    const VF dy = hn::LoadU(df, in.us.direction_y.data() + s);
    const VF dz = hn::LoadU(df, in.us.direction_z.data() + s);
    gradient = hn::Abs(hn::MulAdd(gi, turned(k.m[0], dx, dy, dz, zero),
                                  hn::MulAdd(gj, turned(k.m[1], dx, dy, dz, zero),
                                             hn::Mul(gk, turned(k.m[2], dx, dy, dz, zero)))));
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
  const Constants constants(in);
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
