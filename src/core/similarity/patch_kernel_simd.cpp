// Vectors of unknown size cannot be members, so SVE is left out; machines that have it run NEON.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// The file is compiled once per instruction set; the machine's best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/patch_kernel_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "similarity/lane_sums-inl.h"
#include "similarity/patch_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

// A machine without vector instructions known to Highway runs the scalar reference.
#if HWY_TARGET == HWY_SCALAR
void sum_strands(const PatchKernelInput& in, std::size_t first, std::size_t last,
                 StrandSums* sums) {
  sum_strands_scalar(in, first, last, sums);
}
std::size_t sample_block(const PatchKernelInput& in, std::size_t block, float* values) {
  return sample_block_scalar(in, block, values);
}
void explained_shares(const StrandSums& sums, const double* count, const double* uu,
                      const Lc2Ridge& ridge, double* shares) {
  explained_shares_scalar(sums, count, uu, ridge, shares);
}
#else

const hn::RepartitionToWide<decltype(df)> dd;
const hn::Half<decltype(df)> df_half;
using VD = hn::Vec<decltype(dd)>;

template <GradientChannel kChannel>
HWY_INLINE VF gradient_of(const UltrasoundPatches& us, const Constants& k, std::size_t s,
                          const Sampled& ct) {
  if (kChannel == GradientChannel::kMagnitude) return magnitude(k, ct);
  const VF zero = hn::Zero(df);
  const VF dx = hn::LoadU(df, us.direction_x.data() + s);
  const VF dy = hn::LoadU(df, us.direction_y.data() + s);
  const VF dz = hn::LoadU(df, us.direction_z.data() + s);
  return hn::Abs(hn::MulAdd(ct.gi, turned(k.m[0], dx, dy, dz, zero),
                            hn::MulAdd(ct.gj, turned(k.m[1], dx, dy, dz, zero),
                                       hn::Mul(ct.gk, turned(k.m[2], dx, dy, dz, zero)))));
}

/// Adds rows whose first sample is `s`. The CT of the next row is fetched while this one is
/// interpolated.
template <GradientChannel kChannel, Where kWhere>
HWY_INLINE void add_rows(const UltrasoundPatches& us, const Constants& k, std::size_t s,
                         std::size_t rows, LaneSums& sums) {
  const VF zero = hn::Zero(df);
  const VF one = hn::Set(df, 1.0F);
  if (rows == 0) return;
  LaneSums sum = sums;  // a copy in registers
  const std::size_t last = s + (rows - 1) * kLanes;
  Cells next = fetch<kWhere>(us, k, s);
  for (; s <= last; s += kLanes) {
    const Cells cells = next;
    next = fetch<kWhere>(us, k, std::min(s + kLanes, last));
    const Sampled ct = interpolate(cells);
    const VF value = if_inside<kWhere>(cells, hn::Sub(ct.value, hn::Set(df, k.background)), zero);
    const VF gradient = if_inside<kWhere>(cells, gradient_of<kChannel>(us, k, s, ct), zero);
    const VF u = hn::LoadU(df, us.value.data() + s);
    add(sum, if_inside<kWhere>(cells, one, zero), value, gradient, u);
  }
  sums = sum;
}

template <GradientChannel kChannel, Where kRest>
void sum_all(const PatchKernelInput& in, std::size_t first, std::size_t last, StrandSums* sums) {
  const Constants constants(in);
  for (std::size_t b = first; b < last; ++b, ++sums) {
    const UltrasoundPatches::Block& block = in.us.blocks[b];
    const std::size_t inside = rows_inside(in, block);
    for (std::size_t lane = 0; lane < kLanes; lane += hn::Lanes(df)) {
      LaneSums sum = no_sums();
      const std::size_t begin = block.begin + lane;
      add_rows<kChannel, Where::kInside>(in.us, constants, begin, inside, sum);
      add_rows<kChannel, kRest>(in.us, constants, begin + inside * kLanes, block.rows - inside,
                                sum);
      store(sum, *sums, lane);
    }
  }
}

void sum_strands(const PatchKernelInput& in, std::size_t first, std::size_t last,
                 StrandSums* sums) {
  constexpr auto kMagnitude = GradientChannel::kMagnitude;
  constexpr auto kAlongBeam = GradientChannel::kAlongBeam;
  const bool moved = in.errors.any();
  if (in.channel == kMagnitude)
    (moved ? sum_all<kMagnitude, Where::kMoved>
           : sum_all<kMagnitude, Where::kAnywhere>)(in, first, last, sums);
  else
    (moved ? sum_all<kAlongBeam, Where::kMoved>
           : sum_all<kAlongBeam, Where::kAnywhere>)(in, first, last, sums);
}

template <Where kWhere>
std::size_t sample_all(const PatchKernelInput& in, std::size_t block, float* values) {
  const Constants constants(in);
  const VF background = hn::Set(df, constants.background);
  const std::size_t begin = in.us.blocks[block].begin;
  const std::size_t end = begin + in.us.blocks[block].rows * kLanes;
  std::size_t inside = 0;
  for (std::size_t s = begin; s < end; s += hn::Lanes(df), values += hn::Lanes(df)) {
    const Cells cells = fetch<kWhere>(in.us, constants, s);
    inside += count_inside<kWhere>(cells);
    hn::StoreU(if_inside<kWhere>(cells, interpolate(cells).value, background), df, values);
  }
  return inside;
}

std::size_t sample_block(const PatchKernelInput& in, std::size_t block, float* values) {
  return (in.errors.any() ? sample_all<Where::kMoved> : sample_all<Where::kAnywhere>)(in, block,
                                                                                      values);
}

HWY_INLINE VD wide(const float* values) { return hn::PromoteTo(dd, hn::LoadU(df_half, values)); }

/// explained_share, lane by lane.
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
HWY_EXPORT(explained_shares);

void sum_strands_simd(const PatchKernelInput& input, std::size_t first, std::size_t last,
                      StrandSums* sums) {
  HWY_DYNAMIC_DISPATCH(sum_strands)(input, first, last, sums);
}

std::size_t sample_block_simd(const PatchKernelInput& input, std::size_t block, float* values) {
  return HWY_DYNAMIC_DISPATCH(sample_block)(input, block, values);
}

void explained_shares_simd(const StrandSums& sums, const double* count, const double* uu,
                           const Lc2Ridge& ridge, double* shares) {
  HWY_DYNAMIC_DISPATCH(explained_shares)(sums, count, uu, ridge, shares);
}

}  // namespace usct
#endif
