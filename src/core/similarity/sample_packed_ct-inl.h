// Sampling of a packed CT at ultrasound, for all lanes at once. The kernels include this file after
// hwy/foreach_target.h, once per instruction set; hence the guard that toggles.
#if defined(USCT_SIMILARITY_SAMPLE_PACKED_CT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef USCT_SIMILARITY_SAMPLE_PACKED_CT_INL_H_
#undef USCT_SIMILARITY_SAMPLE_PACKED_CT_INL_H_
#else
#define USCT_SIMILARITY_SAMPLE_PACKED_CT_INL_H_
#endif

#include <hwy/highway.h>

#include <cstring>

#include "similarity/patch_kernel.h"
#include "similarity/word_pairs-inl.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

// A machine without vector instructions known to Highway runs the scalar reference.
#if HWY_TARGET != HWY_SCALAR

namespace hn = hwy::HWY_NAMESPACE;

const hn::CappedTag<float, kLanes> df;
const hn::RebindToSigned<decltype(df)> di;
const hn::RebindToUnsigned<decltype(df)> du;
using VF = hn::Vec<decltype(df)>;
using VI = hn::Vec<decltype(di)>;
using VU = hn::Vec<decltype(du)>;
using MF = hn::Mask<decltype(df)>;

/// The floats from 2^23 to 2^24 are the whole numbers, and their last bits count them, so rounding
/// to such a float gives an index. Indices are shifted by two, since floats below 2^23 include
/// halves.
constexpr float kWhole = 8388608.0F;
constexpr float kShift = 2.0F;

inline std::uint32_t bits_of(float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}

/// Constants that all samples share.
struct Constants {
  explicit Constants(const PatchKernelInput& in) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) m[r][c] = static_cast<float>(in.T_index_us.linear()(r, c));
      origin[r] = static_cast<float>(in.T_index_us.translation()[r]) + kShift;
      last[r] = static_cast<float>(in.ct.grid().size[r] - 1) + kShift;
      per_mm[r] = static_cast<float>(1.0 / in.ct.grid().spacing_mm[r]);
    }
    pairs = in.ct.pairs();
    stride_j = static_cast<std::int32_t>(in.ct.stride_j());
    stride_k = in.ct.stride_k();
    rows = static_cast<float>(in.ct.stride_k() / in.ct.stride_j());
    first_cell = bits_of(kWhole + kShift) +
                 bits_of(kWhole + kShift * rows + kShift) * static_cast<std::uint32_t>(stride_j);
    background = static_cast<float>(in.ct.background());
    depth_error = static_cast<float>(in.errors.depth);
    sweep_error = static_cast<float>(in.errors.sweep);
    unevenness = static_cast<float>(in.errors.unevenness);
  }
  const std::uint16_t* pairs;
  float m[3][3];
  float origin[3];  // + kShift
  float last[3];    // index, + kShift
  float per_mm[3];
  std::int32_t stride_j;     // pairs per row
  std::size_t stride_k;      // pairs per slice
  float rows;                // rows per slice
  std::uint32_t first_cell;  // sum of the bits for cell 0
  float background;
  float depth_error, sweep_error, unevenness;
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

/// Whole numbers in [0, 2^23) as integers; cheaper than a conversion that checks for overflow.
HWY_INLINE VI whole(VF value) {
  const VF offset = hn::Set(df, kWhole);
  return hn::Sub(hn::BitCast(di, hn::Add(value, offset)), hn::BitCast(di, offset));
}

/// Moves positions by AcquisitionErrors.
HWY_INLINE void move(const UltrasoundPatches& us, const Constants& k, std::size_t s, VF& x, VF& y,
                     VF& z) {
  const VF along = hn::Mul(hn::Set(df, k.depth_error), hn::LoadU(df, us.depth_mm.data() + s));
  const VF sweep = hn::MulAdd(hn::Set(df, k.unevenness), hn::LoadU(df, us.sweep_side.data() + s),
                              hn::Set(df, k.sweep_error));
  const auto moved = [&](VF p, const LargeVector<float>& direction,
                         const LargeVector<float>& motion) HWY_ATTR {
    return hn::MulAdd(along, hn::LoadU(df, direction.data() + s),
                      hn::MulAdd(sweep, hn::LoadU(df, motion.data() + s), p));
  };
  x = moved(x, us.direction_x, us.sweep_x);
  y = moved(y, us.direction_y, us.sweep_y);
  z = moved(z, us.direction_z, us.sweep_z);
}

/// The cells in which samples lie, as offsets of their pairs in bytes, and the positions of the
/// samples in the cells.
struct Location {
  MF inside;  // not set if all are known to lie inside
  VI bytes;
  VF ti, tj, tk;
};

/// The corners of cells as bytes (k = 0 in `low`, 1 in `high`; their pairs at i, then at i + 1),
/// and the positions of samples in the cells.
struct Cells {
  MF inside;  // not set if all are known to lie inside
  VU low, high;
  VF ti, tj, tk;
};

/// Location of a row of samples: anywhere; entirely within the CT; or anywhere, and moved by
/// AcquisitionErrors.
enum class Where { kAnywhere, kInside, kMoved };

/// Whether a cell exists at indices + kShift.
HWY_INLINE MF in_ct(const Constants& k, VF x, VF y, VF z) {
  const VF first = hn::Set(df, kShift);
  return hn::And(hn::And(hn::And(hn::Ge(x, first), hn::Lt(x, hn::Set(df, k.last[0]))),
                         hn::And(hn::Ge(y, first), hn::Lt(y, hn::Set(df, k.last[1])))),
                 hn::And(hn::Ge(z, first), hn::Lt(z, hn::Set(df, k.last[2]))));
}

template <Where kWhere>
HWY_INLINE Location locate(const UltrasoundPatches& us, const Constants& k, std::size_t s) {
  VF px = hn::LoadU(df, us.x_mm.data() + s);
  VF py = hn::LoadU(df, us.y_mm.data() + s);
  VF pz = hn::LoadU(df, us.z_mm.data() + s);
  if (kWhere == Where::kMoved) move(us, k, s, px, py, pz);
  const VF x = turned(k.m[0], px, py, pz, hn::Set(df, k.origin[0]));
  const VF y = turned(k.m[1], px, py, pz, hn::Set(df, k.origin[1]));
  const VF z = turned(k.m[2], px, py, pz, hn::Set(df, k.origin[2]));
  // Rounds down to whole numbers, + kWhole. A whole number may become one less, which means the end
  // of the previous cell.
  const VF down = hn::Set(df, kWhole - 0.5F);
  const VF i = hn::Add(x, down);
  const VF j = hn::Add(y, down);
  const VF offset = hn::Set(df, kWhole);
  const VF fz = hn::Sub(hn::Add(z, down), offset);
  const VI row = hn::BitCast(di, hn::MulAdd(fz, hn::Set(df, k.rows), j));
  VI cell = hn::Sub(hn::Add(hn::BitCast(di, i), hn::Mul(row, hn::Set(di, k.stride_j))),
                    hn::BitCast(di, hn::Set(du, k.first_cell)));
  MF inside = hn::MaskFromVec(hn::Zero(df));
  if (kWhere != Where::kInside) {
    inside = in_ct(k, x, y, z);
    cell = hn::IfThenElseZero(hn::RebindMask(di, inside), cell);
  }
  return {inside, hn::ShiftLeft<1>(cell), hn::Sub(x, hn::Sub(i, offset)),
          hn::Sub(y, hn::Sub(j, offset)), hn::Sub(z, fz)};
}

template <Where kWhere>
HWY_INLINE Cells fetch(const UltrasoundPatches& us, const Constants& k, std::size_t s) {
  const Location at = locate<kWhere>(us, k, s);
  Cells cells{at.inside, {}, {}, at.ti, at.tj, at.tk};
  load_from_both(k.pairs, k.pairs + k.stride_k, at.bytes, cells.low, cells.high);
  return cells;
}

/// CT value, and gradient per voxel.
struct Sampled {
  VF value, gi, gj, gk;
};

/// The values at the corners of a cell; the digits are i, j and k.
struct Corners {
  VF c000, c100, c010, c110, c001, c101, c011, c111;
};

HWY_INLINE Sampled interpolate(const Corners& c, VF ti, VF tj, VF tk) {
  // Slopes along i on the four edges are interpolated bilinearly.
  const VF s00 = hn::Sub(c.c100, c.c000);
  const VF s10 = hn::Sub(c.c110, c.c010);
  const VF s01 = hn::Sub(c.c101, c.c001);
  const VF s11 = hn::Sub(c.c111, c.c011);
  const VF e00 = hn::MulAdd(ti, s00, c.c000);
  const VF e10 = hn::MulAdd(ti, s10, c.c010);
  const VF e01 = hn::MulAdd(ti, s01, c.c001);
  const VF e11 = hn::MulAdd(ti, s11, c.c011);
  const VF slope_j0 = hn::Sub(e10, e00);
  const VF slope_j1 = hn::Sub(e11, e01);
  const VF face0 = hn::MulAdd(tj, slope_j0, e00);
  const VF face1 = hn::MulAdd(tj, slope_j1, e01);
  const VF gk = hn::Sub(face1, face0);
  return {hn::MulAdd(tk, gk, face0), lerp(lerp(s00, s10, tj), lerp(s01, s11, tj), tk),
          lerp(slope_j0, slope_j1, tk), gk};
}

HWY_INLINE Sampled interpolate(const Cells& c) {
  return interpolate(
      {byte_of<0>(c.low), byte_of<2>(c.low), byte_of<1>(c.low), byte_of<3>(c.low),
       byte_of<0>(c.high), byte_of<2>(c.high), byte_of<1>(c.high), byte_of<3>(c.high)},
      c.ti, c.tj, c.tk);
}

/// `value` if a sample lies in the CT, `outside` otherwise.
template <Where kWhere>
HWY_INLINE VF if_inside(const Cells& cells, VF value, VF outside) {
  return kWhere == Where::kInside ? value : hn::IfThenElse(cells.inside, value, outside);
}

template <Where kWhere>
HWY_INLINE std::size_t count_inside(const Cells& cells) {
  return kWhere == Where::kInside ? hn::Lanes(df) : hn::CountTrue(df, cells.inside);
}

/// |grad mu|, in bytes per mm.
HWY_INLINE VF magnitude(const Constants& k, const Sampled& ct) {
  const VF gx = hn::Mul(ct.gi, hn::Set(df, k.per_mm[0]));
  const VF gy = hn::Mul(ct.gj, hn::Set(df, k.per_mm[1]));
  const VF gz = hn::Mul(ct.gk, hn::Set(df, k.per_mm[2]));
  return hn::Sqrt(hn::MulAdd(gx, gx, hn::MulAdd(gy, gy, hn::Mul(gz, gz))));
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
