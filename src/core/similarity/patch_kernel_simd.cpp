// Vectors of unknown size cannot be members; NEON serves the machines that have SVE as well.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// Compiled once per instruction set; the best that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/patch_kernel_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "similarity/patch_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

// A machine of which Highway knows no vector instructions runs the reference.
#if HWY_TARGET == HWY_SCALAR
void sum_strands(const PatchKernelInput& in, std::size_t first, std::size_t last,
                 StrandSums* sums) {
  sum_strands_scalar(in, first, last, sums);
}
std::size_t sample_block(const PatchKernelInput& in, std::size_t block, float* values) {
  return sample_block_scalar(in, block, values);
}
std::size_t add_joint(const PatchKernelInput& in, std::size_t block, const float* ultrasound,
                      JointSums& sums) {
  return add_joint_scalar(in, block, ultrasound, sums);
}
void explained_shares(const StrandSums& sums, const double* count, const double* uu,
                      const Lc2Ridge& ridge, double* shares) {
  explained_shares_scalar(sums, count, uu, ridge, shares);
}
#else

namespace hn = hwy::HWY_NAMESPACE;

const hn::CappedTag<float, kLanes> df;
const hn::RebindToSigned<decltype(df)> di;
const hn::RebindToUnsigned<decltype(df)> du;
const hn::Half<decltype(di)> di_half;
const hn::RepartitionToWide<decltype(di)> di64;
const hn::RepartitionToWide<decltype(du)> du64;
const hn::RepartitionToWide<decltype(df)> dd;
const hn::Half<decltype(df)> df_half;
using VF = hn::Vec<decltype(df)>;
using VI = hn::Vec<decltype(di)>;
using VU = hn::Vec<decltype(du)>;
using VD = hn::Vec<decltype(dd)>;
using MF = hn::Mask<decltype(df)>;

/// What stays the same for all samples.
struct Constants {
  explicit Constants(const PatchKernelInput& in) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) m[r][c] = static_cast<float>(in.T_index_us.linear()(r, c));
      origin[r] = static_cast<float>(in.T_index_us.translation()[r]);
      cells[r] = static_cast<float>(in.ct.grid().size[r] - 1);
      per_mm[r] = static_cast<float>(1.0 / in.ct.grid().spacing_mm[r]);
    }
    words = in.ct.cells().data();
    stride_j = static_cast<std::int32_t>(in.ct.cell_stride_j());
    rows = static_cast<float>(in.ct.grid().size.y() - 1);
    background = static_cast<float>(in.ct.background());
    depth_error = static_cast<float>(in.errors.depth);
    sweep_error = static_cast<float>(in.errors.sweep);
  }
  const std::uint64_t* words;
  float m[3][3];
  float origin[3];
  float cells[3];
  float per_mm[3];
  std::int32_t stride_j;  // cells per row
  float rows;             // per slice
  float background;
  float depth_error, sweep_error;
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

/// Whole numbers in [0, 2^23) as integers; less work than a conversion that minds overflow.
HWY_INLINE VI whole(VF value) {
  const VF offset = hn::Set(df, 8388608.0F);  // 2^23: what follows the binary point drops out
  return hn::Sub(hn::BitCast(di, hn::Add(value, offset)), hn::BitCast(di, offset));
}

/// Positions where AcquisitionErrors move the samples to.
HWY_INLINE void move(const UltrasoundPatches& us, const Constants& k, std::size_t s, VF& x, VF& y,
                     VF& z) {
  const VF along = hn::Mul(hn::Set(df, k.depth_error), hn::LoadU(df, us.depth_mm.data() + s));
  const VF sweep = hn::Set(df, k.sweep_error);
  const auto moved = [&](VF p, const LargeVector<float>& direction,
                         const LargeVector<float>& motion) HWY_ATTR {
    return hn::MulAdd(along, hn::LoadU(df, direction.data() + s),
                      hn::MulAdd(sweep, hn::LoadU(df, motion.data() + s), p));
  };
  x = moved(x, us.direction_x, us.sweep_x);
  y = moved(y, us.direction_y, us.sweep_y);
  z = moved(z, us.direction_z, us.sweep_z);
}

/// The corners of cells as bytes (k = 0 in `low`, 1 in `high`), and where in them samples lie.
struct Cells {
  MF inside;
  VU low, high;
  VF ti, tj, tk;
};

template <bool kMoved>
HWY_INLINE Cells fetch(const UltrasoundPatches& us, const Constants& k, std::size_t s) {
  const VF zero = hn::Zero(df);
  VF px = hn::LoadU(df, us.x_mm.data() + s);
  VF py = hn::LoadU(df, us.y_mm.data() + s);
  VF pz = hn::LoadU(df, us.z_mm.data() + s);
  if (kMoved) move(us, k, s, px, py, pz);
  const VF x = turned(k.m[0], px, py, pz, hn::Set(df, k.origin[0]));
  const VF y = turned(k.m[1], px, py, pz, hn::Set(df, k.origin[1]));
  const VF z = turned(k.m[2], px, py, pz, hn::Set(df, k.origin[2]));
  const MF inside = hn::And(hn::And(hn::And(hn::Ge(x, zero), hn::Lt(x, hn::Set(df, k.cells[0]))),
                                    hn::And(hn::Ge(y, zero), hn::Lt(y, hn::Set(df, k.cells[1])))),
                            hn::And(hn::Ge(z, zero), hn::Lt(z, hn::Set(df, k.cells[2]))));
  const VF fx = hn::Floor(x);
  const VF fy = hn::Floor(y);
  const VF fz = hn::Floor(z);
  const VI row = whole(hn::MulAdd(fz, hn::Set(df, k.rows), fy));
  const VI cell = hn::IfThenElseZero(hn::RebindMask(di, inside),
                                     hn::Add(whole(fx), hn::Mul(row, hn::Set(di, k.stride_j))));
  const auto first =
      hn::GatherIndex(du64, k.words, hn::PromoteTo(di64, hn::LowerHalf(di_half, cell)));
  const auto second =
      hn::GatherIndex(du64, k.words, hn::PromoteTo(di64, hn::UpperHalf(di_half, cell)));
  return {inside,
          hn::ConcatEven(du, hn::BitCast(du, second), hn::BitCast(du, first)),
          hn::ConcatOdd(du, hn::BitCast(du, second), hn::BitCast(du, first)),
          hn::Sub(x, fx),
          hn::Sub(y, fy),
          hn::Sub(z, fz)};
}

/// Value, and gradient per voxel.
struct Sampled {
  VF value, gi, gj, gk;
};

HWY_INLINE Sampled interpolate(const Cells& c) {
  const VF c000 = byte_of<0>(c.low);
  const VF c010 = byte_of<2>(c.low);
  const VF c001 = byte_of<0>(c.high);
  const VF c011 = byte_of<2>(c.high);
  // Slopes along i on the four edges, then bilinearly between them.
  const VF s00 = hn::Sub(byte_of<1>(c.low), c000);
  const VF s10 = hn::Sub(byte_of<3>(c.low), c010);
  const VF s01 = hn::Sub(byte_of<1>(c.high), c001);
  const VF s11 = hn::Sub(byte_of<3>(c.high), c011);
  const VF e00 = hn::MulAdd(c.ti, s00, c000);
  const VF e10 = hn::MulAdd(c.ti, s10, c010);
  const VF e01 = hn::MulAdd(c.ti, s01, c001);
  const VF e11 = hn::MulAdd(c.ti, s11, c011);
  const VF slope_j0 = hn::Sub(e10, e00);
  const VF slope_j1 = hn::Sub(e11, e01);
  const VF face0 = hn::MulAdd(c.tj, slope_j0, e00);
  const VF face1 = hn::MulAdd(c.tj, slope_j1, e01);
  const VF gk = hn::Sub(face1, face0);
  return {hn::MulAdd(c.tk, gk, face0), lerp(lerp(s00, s10, c.tj), lerp(s01, s11, c.tj), c.tk),
          lerp(slope_j0, slope_j1, c.tk), gk};
}

template <GradientChannel kChannel>
HWY_INLINE VF gradient_of(const UltrasoundPatches& us, const Constants& k, std::size_t s,
                          const Sampled& ct) {
  if (kChannel == GradientChannel::kMagnitude) {
    const VF gx = hn::Mul(ct.gi, hn::Set(df, k.per_mm[0]));
    const VF gy = hn::Mul(ct.gj, hn::Set(df, k.per_mm[1]));
    const VF gz = hn::Mul(ct.gk, hn::Set(df, k.per_mm[2]));
    return hn::Sqrt(hn::MulAdd(gx, gx, hn::MulAdd(gy, gy, hn::Mul(gz, gz))));
  }
  const VF zero = hn::Zero(df);
  const VF dx = hn::LoadU(df, us.direction_x.data() + s);
  const VF dy = hn::LoadU(df, us.direction_y.data() + s);
  const VF dz = hn::LoadU(df, us.direction_z.data() + s);
  return hn::Abs(hn::MulAdd(ct.gi, turned(k.m[0], dx, dy, dz, zero),
                            hn::MulAdd(ct.gj, turned(k.m[1], dx, dy, dz, zero),
                                       hn::Mul(ct.gk, turned(k.m[2], dx, dy, dz, zero)))));
}

/// The strands of one vector, from sample `s` on.
template <GradientChannel kChannel, bool kMoved>
HWY_INLINE void sum_lanes(const UltrasoundPatches& us, const Constants& k, std::size_t s,
                          std::size_t rows, StrandSums& sums, std::size_t lane) {
  const VF zero = hn::Zero(df);
  VF inside = zero, m = zero, g = zero, mm = zero, gg = zero, mg = zero, um = zero, ug = zero;
  for (std::size_t row = 0; row < rows; ++row, s += kLanes) {
    const Cells cells = fetch<kMoved>(us, k, s);
    const Sampled ct = interpolate(cells);
    const VF value = hn::IfThenElseZero(cells.inside, hn::Sub(ct.value, hn::Set(df, k.background)));
    const VF gradient = hn::IfThenElseZero(cells.inside, gradient_of<kChannel>(us, k, s, ct));
    const VF u = hn::LoadU(df, us.value.data() + s);
    inside = hn::Add(inside, hn::IfThenElseZero(cells.inside, hn::Set(df, 1.0F)));
    m = hn::Add(m, value);
    g = hn::Add(g, gradient);
    mm = hn::MulAdd(value, value, mm);
    gg = hn::MulAdd(gradient, gradient, gg);
    mg = hn::MulAdd(value, gradient, mg);
    um = hn::MulAdd(u, value, um);
    ug = hn::MulAdd(u, gradient, ug);
  }
  hn::StoreU(inside, df, sums.inside + lane);
  hn::StoreU(m, df, sums.m + lane);
  hn::StoreU(g, df, sums.g + lane);
  hn::StoreU(mm, df, sums.mm + lane);
  hn::StoreU(gg, df, sums.gg + lane);
  hn::StoreU(mg, df, sums.mg + lane);
  hn::StoreU(um, df, sums.um + lane);
  hn::StoreU(ug, df, sums.ug + lane);
}

template <GradientChannel kChannel, bool kMoved>
void sum_all(const PatchKernelInput& in, std::size_t first, std::size_t last, StrandSums* sums) {
  const Constants constants(in);
  for (std::size_t b = first; b < last; ++b, ++sums)
    for (std::size_t lane = 0; lane < kLanes; lane += hn::Lanes(df))
      sum_lanes<kChannel, kMoved>(in.us, constants, in.us.blocks[b].begin + lane,
                                  in.us.blocks[b].rows, *sums, lane);
}

bool is_moved(const AcquisitionErrors& errors) {
  return errors.depth != 0.0 || errors.sweep != 0.0;
}

void sum_strands(const PatchKernelInput& in, std::size_t first, std::size_t last,
                 StrandSums* sums) {
  constexpr auto kMagnitude = GradientChannel::kMagnitude;
  constexpr auto kAlongBeam = GradientChannel::kAlongBeam;
  if (in.channel == kMagnitude)
    (is_moved(in.errors) ? sum_all<kMagnitude, true> : sum_all<kMagnitude, false>)(in, first, last,
                                                                                   sums);
  else
    (is_moved(in.errors) ? sum_all<kAlongBeam, true> : sum_all<kAlongBeam, false>)(in, first, last,
                                                                                   sums);
}

template <bool kMoved>
std::size_t sample_all(const PatchKernelInput& in, std::size_t block, float* values) {
  const Constants constants(in);
  const VF background = hn::Set(df, constants.background);
  const std::size_t begin = in.us.blocks[block].begin;
  const std::size_t end = begin + in.us.blocks[block].rows * kLanes;
  std::size_t inside = 0;
  for (std::size_t s = begin; s < end; s += hn::Lanes(df), values += hn::Lanes(df)) {
    const Cells cells = fetch<kMoved>(in.us, constants, s);
    inside += hn::CountTrue(df, cells.inside);
    hn::StoreU(hn::IfThenElse(cells.inside, interpolate(cells).value, background), df, values);
  }
  return inside;
}

std::size_t sample_block(const PatchKernelInput& in, std::size_t block, float* values) {
  return (is_moved(in.errors) ? sample_all<true> : sample_all<false>)(in, block, values);
}

/// Where the samples of a vector go: what the two knots of a row get, ultrasound and count, times 1
/// - `along` (this row) and `along` (the next).
struct Shares {
  alignas(64) float knots[4 * kLanes];
  alignas(64) float along[kLanes];
  alignas(64) std::int32_t at[kLanes];
};

HWY_INLINE void share(VF value, VF gradient, VF u, const JointSums& sums, Shares& shares) {
  const VF row = hn::Mul(value, hn::Set(df, static_cast<float>(sums.rows - 1) / 255.0F));
  const VF column = hn::Mul(hn::Div(gradient, hn::Add(gradient, hn::Set(df, sums.gradient_scale))),
                            hn::Set(df, static_cast<float>(sums.columns - 1)));
  const VI r = hn::Min(hn::ConvertTo(di, row), hn::Set(di, sums.rows - 2));
  const VI c = hn::Min(hn::ConvertTo(di, column), hn::Set(di, sums.columns - 2));
  // What is filled up is not a number, and has no share.
  const MF counts = hn::Eq(u, u);
  const VF along_column = hn::IfThenElseZero(counts, hn::Sub(column, hn::ConvertTo(df, c)));
  const VF rest = hn::Sub(hn::IfThenElseZero(counts, hn::Set(df, 1.0F)), along_column);
  const VF known = hn::IfThenElseZero(counts, u);
  hn::StoreInterleaved4(hn::Mul(rest, known), rest, hn::Mul(along_column, known), along_column, df,
                        shares.knots);
  hn::Store(hn::Sub(row, hn::ConvertTo(df, r)), df, shares.along);
  hn::Store(hn::Add(hn::Mul(r, hn::Set(di, sums.columns)), c), di, shares.at);
}

/// The two knots of a row lie side by side: four numbers.
HWY_INLINE void add_share(const Shares& shares, std::size_t lane, std::size_t row_stride,
                          float* table) {
  const hn::FixedTag<float, 4> d4;
  float* here = table + 2 * static_cast<std::size_t>(shares.at[lane]);
  float* next = here + row_stride;
  const auto knots = hn::Load(d4, shares.knots + 4 * lane);
  const auto along = hn::Set(d4, shares.along[lane]);
  hn::StoreU(hn::MulAdd(knots, along, hn::LoadU(d4, next)), d4, next);
  hn::StoreU(hn::Add(hn::NegMulAdd(knots, along, knots), hn::LoadU(d4, here)), d4, here);
}

template <bool kMoved>
std::size_t add_joint_all(const PatchKernelInput& in, std::size_t block, const float* ultrasound,
                          JointSums& sums) {
  const Constants constants(in);
  const VF background = hn::Set(df, constants.background);
  const std::size_t row_stride = 2 * static_cast<std::size_t>(sums.columns);
  const std::size_t table_size = sums.table_size();
  const std::size_t begin = in.us.blocks[block].begin;
  const std::size_t end = begin + in.us.blocks[block].rows * kLanes;
  std::size_t inside = 0;
  Shares shares;
  for (std::size_t s = begin; s < end; s += hn::Lanes(df)) {
    const Cells cells = fetch<kMoved>(in.us, constants, s);
    const Sampled ct = interpolate(cells);
    inside += hn::CountTrue(df, cells.inside);
    share(hn::IfThenElse(cells.inside, ct.value, background),
          hn::IfThenElseZero(cells.inside,
                             gradient_of<GradientChannel::kMagnitude>(in.us, constants, s, ct)),
          hn::LoadU(df, ultrasound + s), sums, shares);
    for (std::size_t lane = 0; lane < hn::Lanes(df); ++lane)
      add_share(shares, lane, row_stride,
                sums.tables.data() + lane % JointSums::kTables * table_size);
  }
  return inside;
}

std::size_t add_joint(const PatchKernelInput& in, std::size_t block, const float* ultrasound,
                      JointSums& sums) {
  return (is_moved(in.errors) ? add_joint_all<true> : add_joint_all<false>)(in, block, ultrasound,
                                                                            sums);
}

HWY_INLINE VD wide(const float* values) { return hn::PromoteTo(dd, hn::LoadU(df_half, values)); }

/// As explained_share, lane by lane.
HWY_INLINE VD shares_of(const StrandSums& sums, std::size_t i, VD n, VD uu, const Lc2Ridge& ridge) {
  const VD zero = hn::Zero(dd);
  const VD tiny = hn::Set(dd, kLc2Floor);
  const VD per_sample = hn::IfThenZeroElse(hn::Eq(n, zero), hn::Div(hn::Set(dd, 1.0), n));
  const VD m = wide(sums.m + i), g = wide(sums.g + i);
  const VD um = wide(sums.um + i), ug = wide(sums.ug + i);
  const VD sum_mm = wide(sums.mm + i), sum_gg = wide(sums.gg + i);
  const VD m_mean = hn::Mul(m, per_sample);
  const VD g_mean = hn::Mul(g, per_sample);
  const VD mm = hn::NegMulAdd(m, m_mean, sum_mm);
  const VD gg = hn::NegMulAdd(g, g_mean, sum_gg);
  const VD mg = hn::NegMulAdd(m, g_mean, wide(sums.mg + i));
  const VD ridge_m = hn::Set(dd, ridge.intensity * ridge.intensity);
  const VD ridge_g = hn::Set(dd, ridge.gradient * ridge.gradient);
  const VD damped_mm = hn::MulAdd(n, ridge_m, hn::MulAdd(tiny, sum_mm, mm));
  const VD damped_gg = hn::MulAdd(n, ridge_g, hn::MulAdd(tiny, sum_gg, gg));
  const VD determinant = hn::NegMulAdd(mg, mg, hn::Mul(damped_mm, damped_gg));
  const VD b_scaled = hn::NegMulAdd(mg, um, hn::Mul(damped_mm, ug));
  auto alone = hn::Not(hn::Gt(determinant, zero));
  if (ridge.positive_gradient) alone = hn::Or(alone, hn::Lt(b_scaled, zero));
  const VD a_scaled = hn::IfThenElse(alone, um, hn::NegMulAdd(mg, ug, hn::Mul(damped_gg, um)));
  const VD divisor = hn::IfThenElse(alone, damped_mm, determinant);
  const VD scale = hn::IfThenElseZero(hn::Gt(divisor, zero), hn::Div(hn::Set(dd, 1.0), divisor));
  const VD a = hn::Mul(a_scaled, scale);
  const VD b = hn::IfThenZeroElse(alone, hn::Mul(b_scaled, scale));
  // a (2 um - a mm - b mg) + b (2 ug - b gg - a mg)
  const VD two = hn::Set(dd, 2.0);
  const VD by_a = hn::NegMulAdd(a, mm, hn::NegMulAdd(b, mg, hn::Mul(two, um)));
  const VD by_b = hn::NegMulAdd(b, gg, hn::NegMulAdd(a, mg, hn::Mul(two, ug)));
  const VD explained = hn::MulAdd(a, by_a, hn::Mul(b, by_b));
  const VD share = hn::IfThenElseZero(hn::Gt(uu, zero), hn::Div(explained, uu));
  return hn::Min(hn::Max(share, zero), hn::Set(dd, 1.0));
}

void explained_shares(const StrandSums& sums, const double* count, const double* uu,
                      const Lc2Ridge& ridge, double* shares) {
  for (std::size_t i = 0; i < kLanes; i += hn::Lanes(dd))
    hn::StoreU(shares_of(sums, i, hn::LoadU(dd, count + i), hn::LoadU(dd, uu + i), ridge), dd,
               shares + i);
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(sum_strands);
HWY_EXPORT(sample_block);
HWY_EXPORT(add_joint);
HWY_EXPORT(explained_shares);

void sum_strands_simd(const PatchKernelInput& input, std::size_t first, std::size_t last,
                      StrandSums* sums) {
  HWY_DYNAMIC_DISPATCH(sum_strands)(input, first, last, sums);
}

std::size_t sample_block_simd(const PatchKernelInput& input, std::size_t block, float* values) {
  return HWY_DYNAMIC_DISPATCH(sample_block)(input, block, values);
}

std::size_t add_joint_simd(const PatchKernelInput& input, std::size_t block,
                           const float* ultrasound, JointSums& sums) {
  return HWY_DYNAMIC_DISPATCH(add_joint)(input, block, ultrasound, sums);
}

void explained_shares_simd(const StrandSums& sums, const double* count, const double* uu,
                           const Lc2Ridge& ridge, double* shares) {
  HWY_DYNAMIC_DISPATCH(explained_shares)(sums, count, uu, ridge, shares);
}

}  // namespace usct
#endif
