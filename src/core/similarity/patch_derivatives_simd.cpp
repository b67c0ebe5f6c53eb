// Vectors of unknown size cannot be members, so SVE is left out; machines that have it run NEON.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// The file is compiled once per instruction set; the machine's best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/patch_derivatives_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "similarity/lane_sums-inl.h"
#include "similarity/patch_derivatives.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

// A machine without vector instructions known to Highway runs the scalar reference.
#if HWY_TARGET == HWY_SCALAR
void sample_derivatives(const PatchKernelInput& in, std::size_t block, BlockSamples& samples,
                        StrandSums& sums) {
  sample_derivatives_scalar(in, block, samples, sums);
}
void sum_derivatives(const UltrasoundPatches& us, std::size_t block, const BlockSamples& samples,
                     const StrandSlopes& slopes, DerivativeOrder order, DerivativeSums& sums) {
  sum_derivatives_scalar(us, block, samples, slopes, order, sums);
}
#else

/// Words of PackedCt::gradient() at the corners of cells: at i and i + 1, for k (low) and k + 1.
struct WordCells {
  MF inside;  // not set if all are known to lie inside
  VU low0, low1, high0, high1;
  VF ti, tj, tk;
};

template <Where kWhere>
HWY_INLINE WordCells fetch_words(const UltrasoundPatches& us, const Constants& k,
                                 const std::uint32_t* words, std::size_t s) {
  const Location at = locate<kWhere>(us, k, s);
  WordCells cells{at.inside, {}, {}, {}, {}, at.ti, at.tj, at.tk};
  const VI offsets = hn::ShiftLeft<1>(at.bytes);  // words are twice as long as pairs
  load_neighbours(words, offsets, cells.low0, cells.low1);
  load_neighbours(words + k.stride_k, offsets, cells.high0, cells.high1);
  return cells;
}

/// Interpolates the pairs that begin at a byte of the words.
template <int kByte>
HWY_INLINE Sampled interpolate_words(const WordCells& c) {
  return interpolate({byte_of<kByte>(c.low0), byte_of<kByte>(c.low1), byte_of<kByte + 1>(c.low0),
                      byte_of<kByte + 1>(c.low1), byte_of<kByte>(c.high0), byte_of<kByte>(c.high1),
                      byte_of<kByte + 1>(c.high0), byte_of<kByte + 1>(c.high1)},
                     c.ti, c.tj, c.tk);
}

/// Samples rows whose first sample is `s`, in the vector that begins at a lane. The cells of the
/// next row are fetched while these are interpolated.
template <Where kWhere>
HWY_INLINE void sample_rows(const PatchKernelInput& in, const Constants& k, std::size_t s,
                            BlockSamples::Row* out, std::size_t lane, std::size_t rows,
                            LaneSums& sums) {
  if (rows == 0) return;
  const PackedGradient gradient = in.ct.gradient();
  const VF per_step = hn::Set(df, static_cast<float>(gradient.step_per_mm));
  const std::uint32_t* words = gradient.words;
  LaneSums sum = sums;  // a copy in registers
  const std::size_t last = s + (rows - 1) * kLanes;
  WordCells next = fetch_words<kWhere>(in.us, k, words, s);
  for (; s <= last; s += kLanes, ++out) {
    const WordCells cells = next;
    next = fetch_words<kWhere>(in.us, k, words, std::min(s + kLanes, last));
    const Sampled ct = interpolate_words<0>(cells);
    const Sampled slope = interpolate_words<2>(cells);
    const auto inside = [&](VF value) HWY_ATTR {
      return kWhere == Where::kInside ? value : hn::IfThenElseZero(cells.inside, value);
    };
    const VF m = inside(hn::Sub(ct.value, hn::Set(df, k.background)));
    const VF g = inside(magnitude(k, ct));
    const VF u = hn::LoadU(df, in.us.value.data() + s);
    hn::StoreU(m, df, out->m + lane);
    hn::StoreU(g, df, out->g + lane);
    hn::StoreU(inside(ct.gi), df, out->by_m[0] + lane);
    hn::StoreU(inside(ct.gj), df, out->by_m[1] + lane);
    hn::StoreU(inside(ct.gk), df, out->by_m[2] + lane);
    hn::StoreU(inside(hn::Mul(per_step, slope.gi)), df, out->by_g[0] + lane);
    hn::StoreU(inside(hn::Mul(per_step, slope.gj)), df, out->by_g[1] + lane);
    hn::StoreU(inside(hn::Mul(per_step, slope.gk)), df, out->by_g[2] + lane);
    add(sum, inside(hn::Set(df, 1.0F)), m, g, u);
  }
  sums = sum;
}

template <Where kRest>
void sample_all(const PatchKernelInput& in, std::size_t b, BlockSamples& samples,
                StrandSums& sums) {
  const Constants constants(in);
  const UltrasoundPatches::Block& block = in.us.blocks[b];
  const std::size_t inside = rows_inside(in, block);
  for (std::size_t lane = 0; lane < kLanes; lane += hn::Lanes(df)) {
    LaneSums sum = no_sums();
    const std::size_t begin = block.begin + lane;
    sample_rows<Where::kInside>(in, constants, begin, samples.rows, lane, inside, sum);
    sample_rows<kRest>(in, constants, begin + inside * kLanes, samples.rows + inside, lane,
                       block.rows - inside, sum);
    store(sum, sums, lane);
  }
}

void sample_derivatives(const PatchKernelInput& in, std::size_t block, BlockSamples& samples,
                        StrandSums& sums) {
  (in.errors.any() ? sample_all<Where::kMoved> : sample_all<Where::kAnywhere>)(in, block, samples,
                                                                               sums);
}

struct V3 {
  VF x, y, z;
};

HWY_INLINE V3 load(const float (&from)[3][kLanes], std::size_t lane) {
  return {hn::LoadU(df, from[0] + lane), hn::LoadU(df, from[1] + lane),
          hn::LoadU(df, from[2] + lane)};
}

HWY_INLINE void store(const V3& from, float (*to)[kLanes], std::size_t lane) {
  hn::StoreU(from.x, df, to[0] + lane);
  hn::StoreU(from.y, df, to[1] + lane);
  hn::StoreU(from.z, df, to[2] + lane);
}

/// a v + b w
HWY_INLINE V3 combined(VF a, const V3& v, VF b, const V3& w) {
  return {hn::MulAdd(a, v.x, hn::Mul(b, w.x)), hn::MulAdd(a, v.y, hn::Mul(b, w.y)),
          hn::MulAdd(a, v.z, hn::Mul(b, w.z))};
}

HWY_INLINE V3 plus(const V3& sum, VF factor, const V3& v) {
  return {hn::MulAdd(factor, v.x, sum.x), hn::MulAdd(factor, v.y, sum.y),
          hn::MulAdd(factor, v.z, sum.z)};
}

template <DerivativeOrder kOrder>
void sum_all(const UltrasoundPatches& us, std::size_t block, const BlockSamples& samples,
             const StrandSlopes& slopes, DerivativeSums& sums) {
  const float* values = us.value.data() + us.blocks[block].begin;
  const std::size_t rows = us.blocks[block].rows;
  const VF zero = hn::Zero(df);
  const VF one = hn::Set(df, 1.0F);
  const V3 zeros{zero, zero, zero};
  for (std::size_t lane = 0; lane < kLanes; lane += hn::Lanes(df)) {
    const auto of = [&](const float* slope) HWY_ATTR { return hn::LoadU(df, slope + lane); };
    const VF mg = of(slopes.mg);
    V3 share_sum = zeros, d_sum = zeros, dm = zeros, dg = zeros, squares = zeros, products = zeros;
    for (std::size_t r = 0; r < rows; ++r) {
      const BlockSamples::Row& row = samples.rows[r];
      const VF u = hn::LoadU(df, values + r * kLanes + lane);
      const VF m = hn::LoadU(df, row.m + lane);
      const VF g = hn::LoadU(df, row.g + lane);
      const V3 by_m = load(row.by_m, lane);
      const V3 by_g = load(row.by_g, lane);
      const VF alpha = hn::MulAdd(
          of(slopes.um), u, hn::MulAdd(of(slopes.mm), m, hn::MulAdd(mg, g, of(slopes.m_offset))));
      const VF beta = hn::MulAdd(
          of(slopes.ug), u, hn::MulAdd(mg, m, hn::MulAdd(of(slopes.gg), g, of(slopes.g_offset))));
      share_sum = plus(plus(share_sum, alpha, by_m), beta, by_g);
      if (kOrder == DerivativeOrder::kGradient) continue;
      const V3 d = combined(of(slopes.a), by_m, of(slopes.b), by_g);
      d_sum = plus(d_sum, one, d);
      dm = plus(dm, m, d);
      dg = plus(dg, g, d);
      squares = {hn::MulAdd(d.x, d.x, squares.x), hn::MulAdd(d.y, d.y, squares.y),
                 hn::MulAdd(d.z, d.z, squares.z)};
      products = {hn::MulAdd(d.x, d.y, products.x), hn::MulAdd(d.x, d.z, products.y),
                  hn::MulAdd(d.y, d.z, products.z)};
    }
    store(share_sum, sums.share, lane);
    if (kOrder == DerivativeOrder::kGradient) continue;
    store(d_sum, sums.d, lane);
    store(dm, sums.dm, lane);
    store(dg, sums.dg, lane);
    store(squares, sums.dd, lane);
    store(products, sums.dd + 3, lane);
  }
}

void sum_derivatives(const UltrasoundPatches& us, std::size_t block, const BlockSamples& samples,
                     const StrandSlopes& slopes, DerivativeOrder order, DerivativeSums& sums) {
  constexpr auto kGradient = DerivativeOrder::kGradient;
  constexpr auto kCurvature = DerivativeOrder::kCurvature;
  (order == kGradient ? sum_all<kGradient> : sum_all<kCurvature>)(us, block, samples, slopes, sums);
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(sample_derivatives);
HWY_EXPORT(sum_derivatives);

void sample_derivatives_simd(const PatchKernelInput& input, std::size_t block,
                             BlockSamples& samples, StrandSums& sums) {
  HWY_DYNAMIC_DISPATCH(sample_derivatives)(input, block, samples, sums);
}

void sum_derivatives_simd(const UltrasoundPatches& us, std::size_t block,
                          const BlockSamples& samples, const StrandSlopes& slopes,
                          DerivativeOrder order, DerivativeSums& sums) {
  HWY_DYNAMIC_DISPATCH(sum_derivatives)(us, block, samples, slopes, order, sums);
}

}  // namespace usct
#endif
