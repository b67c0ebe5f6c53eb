// Vectors of unknown size cannot be members, so SVE is left out; machines that have it run NEON.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// The file is compiled once per instruction set; the machine's best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/joint_derivatives_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "similarity/joint_derivatives.h"
#include "similarity/sample_packed_ct-inl.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

// A machine without vector instructions known to Highway runs the scalar reference.
#if HWY_TARGET == HWY_SCALAR
void add_joint_derivatives(const JointDerivativesInput& in, std::size_t block,
                           const BlockSamples& samples, DerivativeOrder order,
                           JointDerivatives& sums) {
  add_joint_derivatives_scalar(in, block, samples, order, sums);
}
#else

/// Constants that all samples share.
struct JointConstants {
  explicit JointConstants(const JointDerivativesInput& in)
      : function(in.function),
        columns(in.sums.columns),
        background(static_cast<float>(in.sums.samples.ct.background())),
        scale(static_cast<float>(in.sums.gradient_scale_hu_per_mm / in.sums.samples.ct.step_hu())),
        rows_per_byte(static_cast<float>(in.sums.rows - 1) / 255.0F),
        column_gaps(static_cast<float>(in.sums.columns - 1)),
        last_row(static_cast<float>(in.sums.rows - 2)),
        last_column(static_cast<float>(in.sums.columns - 2)) {
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        to_us[r][c] = static_cast<float>(in.sums.samples.T_index_us.linear()(c, r));
  }
  const float* function;
  int columns;
  float background, scale, rows_per_byte, column_gaps, last_row, last_column;
  float to_us[3][3];  // turns derivatives by indices into those by positions in the US frame, mm
};

/// The slopes of a sample by CT value and gradient: of the value, and of the function.
struct Slopes {
  VF value_m, value_g, function_m, function_g;
};

/// The function at knots of a row, and at the next ones of the row.
HWY_INLINE void of_knots(const float* row, VI knots, VF& these, VF& next) {
  VU first, second;
  load_neighbours(reinterpret_cast<const std::uint32_t*>(row), hn::ShiftLeft<2>(knots), first,
                  second);
  these = hn::BitCast(df, first);
  next = hn::BitCast(df, second);
}

HWY_INLINE Slopes slopes_at(const JointConstants& k, VF m, VF g, VF u) {
  const VF scale = hn::Set(df, k.scale);
  const VF inverse = hn::Div(hn::Set(df, 1.0F), hn::Add(g, scale));
  const VF row = hn::Mul(hn::Add(m, hn::Set(df, k.background)), hn::Set(df, k.rows_per_byte));
  const VF column = hn::Mul(hn::Mul(g, inverse), hn::Set(df, k.column_gaps));
  const VF r = hn::Min(hn::Floor(row), hn::Set(df, k.last_row));
  const VF c = hn::Min(hn::Floor(column), hn::Set(df, k.last_column));
  const VF along_row = hn::Sub(row, r);
  const VF along_column = hn::Sub(column, c);
  const VI at = whole(hn::MulAdd(r, hn::Set(df, static_cast<float>(k.columns)), c));
  VF f00, f01, f10, f11;
  of_knots(k.function, at, f00, f01);
  of_knots(k.function + k.columns, at, f10, f11);
  const VF by_m = hn::Set(df, k.rows_per_byte);
  const VF by_g = hn::Mul(hn::Mul(inverse, inverse), hn::Set(df, k.column_gaps * k.scale));
  const VF twice = hn::Add(u, u);
  const auto explained = [&](VF f) HWY_ATTR { return hn::Mul(f, hn::Sub(twice, f)); };
  const VF v00 = explained(f00), v01 = explained(f01), v10 = explained(f10), v11 = explained(f11);
  return {hn::Mul(by_m, lerp(hn::Sub(v10, v00), hn::Sub(v11, v01), along_column)),
          hn::Mul(by_g, lerp(hn::Sub(v01, v00), hn::Sub(v11, v10), along_row)),
          hn::Mul(by_m, lerp(hn::Sub(f10, f00), hn::Sub(f11, f01), along_column)),
          hn::Mul(by_g, lerp(hn::Sub(f01, f00), hn::Sub(f11, f10), along_row))};
}

/// The change of a sample by a motion, from its slopes.
HWY_INLINE void by_motion(const JointConstants& k, const BlockSamples::Row& row, std::size_t lane,
                          VF slope_m, VF slope_g, VF x, VF y, VF z, VF (&change)[6]) {
  const auto along = [&](int axis) HWY_ATTR {
    return hn::MulAdd(slope_m, hn::LoadU(df, row.by_m[axis] + lane),
                      hn::Mul(slope_g, hn::LoadU(df, row.by_g[axis] + lane)));
  };
  const VF i = along(0), j = along(1), l = along(2);
  const VF zero = hn::Zero(df);
  const VF fx = turned(k.to_us[0], i, j, l, zero);
  const VF fy = turned(k.to_us[1], i, j, l, zero);
  const VF fz = turned(k.to_us[2], i, j, l, zero);
  change[0] = hn::MulSub(y, fz, hn::Mul(z, fy));
  change[1] = hn::MulSub(z, fx, hn::Mul(x, fz));
  change[2] = hn::MulSub(x, fy, hn::Mul(y, fx));
  change[3] = fx;
  change[4] = fy;
  change[5] = fz;
}

HWY_INLINE double sum_of(VF lanes) {
  return static_cast<double>(hn::GetLane(hn::SumOfLanes(df, lanes)));
}

template <DerivativeOrder kOrder>
void add_all(const JointDerivativesInput& in, std::size_t block, const BlockSamples& samples,
             JointDerivatives& sums) {
  const JointConstants k(in);
  const UltrasoundPatches& us = in.sums.samples.us;
  const std::size_t begin = us.blocks[block].begin;
  const VF zero = hn::Zero(df);
  for (std::size_t lane = 0; lane < kLanes; lane += hn::Lanes(df)) {
    VF value[6], function[JointDerivatives::kProducts];
    for (VF& sum : value) sum = zero;
    for (VF& sum : function) sum = zero;
    for (std::size_t r = 0; r < us.blocks[block].rows; ++r) {
      const BlockSamples::Row& row = samples.rows[r];
      const std::size_t s = begin + r * kLanes + lane;
      // Padding, whose ultrasound is NaN, lies outside the CT, where nothing changes.
      const VF known = hn::LoadU(df, in.sums.ultrasound + s);
      const VF u = hn::IfThenElseZero(hn::Eq(known, known), known);
      const Slopes slopes =
          slopes_at(k, hn::LoadU(df, row.m + lane), hn::LoadU(df, row.g + lane), u);
      const VF x = hn::LoadU(df, us.x_mm.data() + s);
      const VF y = hn::LoadU(df, us.y_mm.data() + s);
      const VF z = hn::LoadU(df, us.z_mm.data() + s);
      VF change[6];
      by_motion(k, row, lane, slopes.value_m, slopes.value_g, x, y, z, change);
      for (int p = 0; p < 6; ++p) value[p] = hn::Add(value[p], change[p]);
      if (kOrder == DerivativeOrder::kGradient) continue;
      by_motion(k, row, lane, slopes.function_m, slopes.function_g, x, y, z, change);
      std::size_t at = 0;
      for (int p = 0; p < 6; ++p)
        for (int q = 0; q <= p; ++q, ++at)
          function[at] = hn::MulAdd(change[p], change[q], function[at]);
    }
    for (int p = 0; p < 6; ++p) sums.value[p] += sum_of(value[p]);
    if (kOrder == DerivativeOrder::kGradient) continue;
    for (std::size_t i = 0; i < JointDerivatives::kProducts; ++i)
      sums.function[i] += sum_of(function[i]);
  }
}

void add_joint_derivatives(const JointDerivativesInput& in, std::size_t block,
                           const BlockSamples& samples, DerivativeOrder order,
                           JointDerivatives& sums) {
  (order == DerivativeOrder::kGradient
       ? add_all<DerivativeOrder::kGradient>
       : add_all<DerivativeOrder::kCurvature>)(in, block, samples, sums);
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(add_joint_derivatives);

void add_joint_derivatives_simd(const JointDerivativesInput& input, std::size_t block,
                                const BlockSamples& samples, DerivativeOrder order,
                                JointDerivatives& sums) {
  HWY_DYNAMIC_DISPATCH(add_joint_derivatives)(input, block, samples, order, sums);
}

}  // namespace usct
#endif
