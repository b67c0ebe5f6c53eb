// Vectors of unknown size cannot be members; NEON serves the machines that have SVE as well.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// Compiled once per instruction set; the best that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/joint_sums_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "similarity/joint_sums.h"
#include "similarity/sample_packed_ct-inl.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR
JointSums joint_sums(const JointSumsInput& in) { return joint_sums_scalar(in); }
#else

/// Neighbouring samples often share a knot; each of them has a table of its own, so that one need
/// not wait for the other's sum.
constexpr std::size_t kTables = 4;
constexpr std::size_t kPerKnot = 2;  // ultrasound, count

/// Where each lane's sample goes: what its row's two knots get, times 1 - `along` (this row) and
/// `along` (the next).
struct Shares {
  alignas(64) float knots[4 * 16];
  alignas(64) float along[16];
  alignas(64) std::int32_t at[16];
};

HWY_INLINE void share(const JointSumsInput& in, VF value, VF gradient, VF scale, VF u,
                      Shares& shares) {
  const VF one = hn::Set(df, 1.0F);
  const VF row = hn::Mul(value, hn::Set(df, static_cast<float>(in.rows - 1) / 255.0F));
  const VF column = hn::Mul(hn::Div(gradient, hn::Add(gradient, scale)),
                            hn::Set(df, static_cast<float>(in.columns - 1)));
  const auto r = hn::Min(hn::ConvertTo(di, row), hn::Set(di, in.rows - 2));
  const auto c = hn::Min(hn::ConvertTo(di, column), hn::Set(di, in.columns - 2));
  const VF along_column = hn::Sub(column, hn::ConvertTo(df, c));
  const VF rest = hn::Sub(one, along_column);
  hn::StoreInterleaved4(hn::Mul(rest, u), rest, hn::Mul(along_column, u), along_column, df,
                        shares.knots);
  hn::Store(hn::Sub(row, hn::ConvertTo(df, r)), df, shares.along);
  hn::Store(hn::Add(hn::Mul(r, hn::Set(di, in.columns)), c), di, shares.at);
}

HWY_INLINE void add(const Shares& shares, std::size_t lane, std::size_t row_stride, float* table) {
  const hn::FixedTag<float, 4> d4;
  float* here = table + kPerKnot * static_cast<std::size_t>(shares.at[lane]);
  float* next = here + row_stride;
  const auto knots = hn::Load(d4, shares.knots + 4 * lane);
  const auto along = hn::Set(d4, shares.along[lane]);
  hn::StoreU(hn::MulAdd(knots, along, hn::LoadU(d4, next)), d4, next);
  hn::StoreU(hn::Add(hn::NegMulAdd(knots, along, knots), hn::LoadU(d4, here)), d4, here);
}

JointSums joint_sums(const JointSumsInput& in) {
  const Constants constants(in.ct, in.T_index_us);
  const std::size_t row_stride = kPerKnot * static_cast<std::size_t>(in.columns);
  const std::size_t table_size = row_stride * static_cast<std::size_t>(in.rows);
  std::vector<float> tables(kTables * table_size);
  const VF scale = hn::Set(df, static_cast<float>(in.gradient_scale_hu_per_mm / in.ct.step_hu()));
  const VF background = hn::Set(df, constants.background);
  VF inside_sum = hn::Zero(df);
  Shares shares;
  for (const UltrasoundPatches::Patch& patch : in.us.patches) {
    const VF mean = hn::Set(df, static_cast<float>(patch.mean));
    const std::size_t end = patch.begin + patch.count;
    for (std::size_t s = patch.begin; s < end; s += hn::Lanes(df)) {
      VF value = background;
      VF gradient = hn::Zero(df);
      hn::Mask<decltype(df)> inside;
      Sampled ct;
      if (sample(constants, hn::LoadU(df, in.x_mm + s), hn::LoadU(df, in.y_mm + s),
                 hn::LoadU(df, in.z_mm + s), inside, ct)) {
        value = hn::IfThenElse(inside, ct.value, background);
        gradient = hn::IfThenElseZero(inside, magnitude(constants, ct));
        inside_sum = hn::Add(inside_sum, hn::IfThenElseZero(inside, hn::Set(df, 1.0F)));
      }
      share(in, value, gradient, scale, hn::Add(hn::LoadU(df, in.us.value.data() + s), mean),
            shares);
      const std::size_t lanes = end - s < hn::Lanes(df) ? end - s : hn::Lanes(df);
      for (std::size_t lane = 0; lane < lanes; ++lane)
        add(shares, lane, row_stride, tables.data() + (lane % kTables) * table_size);
    }
  }
  JointSums sums;
  sums.rows = in.rows;
  sums.columns = in.columns;
  for (std::size_t knot = 0; knot < table_size; knot += kPerKnot) {
    double ultrasound = 0.0;
    double count = 0.0;
    for (std::size_t t = 0; t < kTables; ++t) {
      ultrasound += static_cast<double>(tables[t * table_size + knot]);
      count += static_cast<double>(tables[t * table_size + knot + 1]);
    }
    sums.ultrasound.push_back(ultrasound);
    sums.count.push_back(count);
  }
  sums.inside = static_cast<double>(hn::GetLane(hn::SumOfLanes(df, inside_sum)));
  return sums;
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(joint_sums);

JointSums joint_sums_simd(const JointSumsInput& input) {
  return HWY_DYNAMIC_DISPATCH(joint_sums)(input);
}

}  // namespace usct
#endif
