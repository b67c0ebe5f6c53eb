// Sampling of a packed CT, for all lanes at once. Compiled once per instruction set: included by
// the kernels after hwy/foreach_target.h, hence the guard that toggles.
#if defined(USCT_SIMILARITY_SAMPLE_PACKED_CT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef USCT_SIMILARITY_SAMPLE_PACKED_CT_INL_H_
#undef USCT_SIMILARITY_SAMPLE_PACKED_CT_INL_H_
#else
#define USCT_SIMILARITY_SAMPLE_PACKED_CT_INL_H_
#endif

#include <hwy/highway.h>

#include "us_ct_registration/similarity/packed_ct.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

// A machine of which Highway knows no vector instructions runs the reference.
#if HWY_TARGET != HWY_SCALAR

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
  Constants(const PackedCt& ct, const Eigen::Affine3d& T_index_us) : words(ct.cells().data()) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) m[r][c] = static_cast<float>(T_index_us.linear()(r, c));
      origin[r] = static_cast<float>(T_index_us.translation()[r]);
      cells[r] = static_cast<float>(ct.grid().size[r] - 1);
      per_mm[r] = static_cast<float>(1.0 / ct.grid().spacing_mm[r]);
    }
    stride_j = static_cast<std::int32_t>(ct.cell_stride_j());
    stride_k = static_cast<std::int32_t>(ct.cell_stride_k());
    background = static_cast<float>(ct.background());
  }
  float m[3][3];
  float origin[3];
  float cells[3];
  float per_mm[3];
  std::int32_t stride_j, stride_k;
  float background;
  const std::uint64_t* words;
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

/// CT values (in bytes) and their slopes per voxel; what is not inside is nothing.
struct Sampled {
  VF value, slope_i, slope_j, slope_k;
};

/// `inside` is where the positions lie in the CT; false if none does.
HWY_INLINE bool sample(const Constants& k, VF px, VF py, VF pz, hn::Mask<decltype(df)>& inside,
                       Sampled& ct) {
  const VF zero = hn::Zero(df);
  const VF x = turned(k.m[0], px, py, pz, hn::Set(df, k.origin[0]));
  const VF y = turned(k.m[1], px, py, pz, hn::Set(df, k.origin[1]));
  const VF z = turned(k.m[2], px, py, pz, hn::Set(df, k.origin[2]));
  inside = hn::And(hn::And(hn::And(hn::Ge(x, zero), hn::Lt(x, hn::Set(df, k.cells[0]))),
                           hn::And(hn::Ge(y, zero), hn::Lt(y, hn::Set(df, k.cells[1])))),
                   hn::And(hn::Ge(z, zero), hn::Lt(z, hn::Set(df, k.cells[2]))));
  if (hn::AllFalse(df, inside)) return false;

  // Truncation is floor: what is inside is not negative.
  const auto i = hn::ConvertTo(di, hn::IfThenElseZero(inside, x));
  const auto j = hn::ConvertTo(di, hn::IfThenElseZero(inside, y));
  const auto l = hn::ConvertTo(di, hn::IfThenElseZero(inside, z));
  const auto cell =
      hn::Add(hn::Add(i, hn::Mul(j, hn::Set(di, k.stride_j))), hn::Mul(l, hn::Set(di, k.stride_k)));
  const auto first =
      hn::GatherIndex(du64, k.words, hn::PromoteTo(di64, hn::LowerHalf(di_half, cell)));
  const auto second =
      hn::GatherIndex(du64, k.words, hn::PromoteTo(di64, hn::UpperHalf(di_half, cell)));
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

  ct = {hn::MulAdd(tk, gk, face0), gi, gj, gk};
  return true;
}

/// |grad mu|, in bytes per mm.
HWY_INLINE VF magnitude(const Constants& k, const Sampled& ct) {
  const VF gx = hn::Mul(ct.slope_i, hn::Set(df, k.per_mm[0]));
  const VF gy = hn::Mul(ct.slope_j, hn::Set(df, k.per_mm[1]));
  const VF gz = hn::Mul(ct.slope_k, hn::Set(df, k.per_mm[2]));
  return hn::Sqrt(hn::MulAdd(gx, gx, hn::MulAdd(gy, gy, hn::Mul(gz, gz))));
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
