// Sampling of the CT at a vector of points for the kernel of simulated_lc2. The kernel includes
// this file after hwy/foreach_target.h, once per instruction set; hence the guard that toggles.

#if defined(USCT_SIMULATED_LC2_VOXELS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef USCT_SIMULATED_LC2_VOXELS_INL_H_
#undef USCT_SIMULATED_LC2_VOXELS_INL_H_
#else
#define USCT_SIMULATED_LC2_VOXELS_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstdint>

#include "similarity/simulated_lc2_kernel.h"
#include "similarity/simulated_lc2_sums-inl.h"

HWY_BEFORE_NAMESPACE();
namespace usct::simulated_lc2::HWY_NAMESPACE {
namespace {

HWY_INLINE M none() { return hn::FirstN(d, 0); }

HWY_INLINE V lerp(V a, V b, V w) { return hn::MulAdd(w, hn::Sub(b, a), a); }

struct Index {
  V x, y, z;
};

/// The cell of voxels around a continuous index.
struct Cell {
  Index index;  // within the CT
  VI lower;     // offset of the voxel at or below
  Index w;      // weights of the voxels above
};

HWY_INLINE M within(const Scene& scene, int axis, V index) {
  const V end = hn::Set(d, static_cast<float>(scene.size[axis]) - 0.5F);
  return hn::And(hn::Ge(index, hn::Set(d, -0.5F)), hn::Lt(index, end));
}

HWY_INLINE M contains(const Scene& scene, const Index& index) {
  return hn::And(within(scene, 0, index.x),
                 hn::And(within(scene, 1, index.y), within(scene, 2, index.z)));
}

HWY_INLINE V last_of(const Scene& scene, int axis) {
  return hn::Set(d, static_cast<float>(scene.size[axis] - 1));
}

HWY_INLINE V kept_within(const Scene& scene, int axis, V index) {
  index = hn::Min(hn::Max(index, hn::Zero(d)), last_of(scene, axis));
  return scene.nearest ? hn::Floor(hn::Add(index, hn::Set(d, 0.5F))) : index;
}

HWY_INLINE Index kept_within(const Scene& scene, const Index& index) {
  return {kept_within(scene, 0, index.x), kept_within(scene, 1, index.y),
          kept_within(scene, 2, index.z)};
}

/// With trilinear sampling the voxel above is in the CT as well; at the CT's end its weight is 1.
HWY_INLINE VI lower_voxel(const Scene& scene, int axis, V index) {
  const int above = scene.nearest || scene.size[axis] == 1 ? 0 : 1;
  return hn::Min(hn::ConvertTo(di, index), hn::Set(di, scene.size[axis] - 1 - above));
}

/// The cell of an index within the CT.
HWY_INLINE Cell cell_at(const Scene& scene, const Index& index) {
  const VI i = lower_voxel(scene, 0, index.x);
  const VI j = lower_voxel(scene, 1, index.y);
  const VI k = lower_voxel(scene, 2, index.z);
  const VI row = hn::Add(hn::Mul(k, hn::Set(di, scene.size[1])), j);
  return {index,
          hn::Add(hn::Mul(row, hn::Set(di, scene.size[0])), i),
          {hn::Sub(index.x, hn::ConvertTo(d, i)), hn::Sub(index.y, hn::ConvertTo(d, j)),
           hn::Sub(index.z, hn::ConvertTo(d, k))}};
}

/// Offsets from a voxel to the next along each axis.
struct Strides {
  explicit HWY_INLINE Strides(const Scene& scene)
      : x(scene.size[0] > 1 ? 1 : 0),
        y(scene.size[1] > 1 ? scene.size[0] : 0),
        z(scene.size[2] > 1 ? std::int64_t{scene.size[0]} * scene.size[1] : 0) {}
  std::int64_t x, y, z;
};

/// Interpolated values of PackedVoxel.
struct Voxels {
  V hu;
  Index difference;
};

#if HWY_TARGET == HWY_SCALAR

HWY_INLINE Voxels load(const PackedVoxel& voxel) {
  const auto value = [](std::int16_t hu) { return hn::Set(d, static_cast<float>(hu)); };
  return {value(voxel.hu),
          {value(voxel.difference[0]), value(voxel.difference[1]), value(voxel.difference[2])}};
}

HWY_INLINE Voxels lerp(const Voxels& a, const Voxels& b, V w) {
  return {lerp(a.hu, b.hu, w),
          {lerp(a.difference.x, b.difference.x, w), lerp(a.difference.y, b.difference.y, w),
           lerp(a.difference.z, b.difference.z, w)}};
}

template <bool kNearest>
HWY_INLINE Voxels sample(const Scene& scene, const Cell& cell) {
  const PackedVoxel* voxels = scene.voxels + hn::GetLane(cell.lower);
  if (kNearest) return load(*voxels);
  const Strides step(scene);
  const auto along_x = [&](std::int64_t start) {
    return lerp(load(voxels[start]), load(voxels[start + step.x]), cell.w.x);
  };
  return lerp(lerp(along_x(0), along_x(step.y), cell.w.y),
              lerp(along_x(step.z), along_x(step.z + step.y), cell.w.y), cell.w.z);
}

#else

/// Sums of the products of the two 16-bit integers in each lane.
HWY_INLINE VI sum_of_products(VI a, VI b) {
#if HWY_ARCH_X86
  using DI16 = hn::Repartition<std::int16_t, D>;
  VI rest = hn::Zero(di);
  return hn::ReorderWidenMulAccumulate(di, hn::BitCast(DI16(), a), hn::BitCast(DI16(), b),
                                       hn::Zero(di), rest);
#else
  const VI low =
      hn::Mul(hn::ShiftRight<16>(hn::ShiftLeft<16>(a)), hn::ShiftRight<16>(hn::ShiftLeft<16>(b)));
  return hn::Add(low, hn::Mul(hn::ShiftRight<16>(a), hn::ShiftRight<16>(b)));
#endif
}

/// One voxel and the next along x for every fourth lane: a block of four 32-bit lanes has those of
/// its own first lane. `lower` begins at the lane wanted in the first block.
HWY_INLINE VI load(const PackedVoxel* row, const std::int32_t* lower) {
  const auto at = [&](int block) HWY_ATTR {
    return hn::LoadDup128(di, reinterpret_cast<const std::int32_t*>(row + lower[4 * block]));
  };
  VI both = at(0);
  for (int block = 1; block < static_cast<int>(hn::Lanes(d)) / 4; ++block)
    both = hn::IfThenElse(hn::Not(hn::FirstN(di, static_cast<std::size_t>(4 * block))), at(block),
                          both);
  return both;
}

/// Largest weight of an interpolation along x, which is one of integers.
constexpr float kMostWeight = 32767.0F;

/// Values of a voxel, kMostWeight times as large, in the four lanes of each block: interpolated at
/// the block's lane `kLane`.
template <bool kNearest, int kLane>
HWY_INLINE V values_at(const Scene& scene, const std::int32_t* lower, VI weights, const Index& w) {
  // The integers of two voxels in turn.
  alignas(16) static constexpr std::uint8_t kInTurn[16] = {0, 1, 8,  9,  2, 3, 10, 11,
                                                           4, 5, 12, 13, 6, 7, 14, 15};
  using DU8 = hn::Repartition<std::uint8_t, D>;
  const auto in_turn = hn::BitCast(di, hn::LoadDup128(DU8(), kInTurn));
  const VI along_x = hn::Broadcast<kLane>(weights);
  const auto row = [&](std::int64_t start) HWY_ATTR {
    const VI both = load(scene.voxels + start, lower + kLane);
    return hn::ConvertTo(d, sum_of_products(hn::TableLookupBytes(both, in_turn), along_x));
  };
  if (kNearest) return row(0);
  const Strides step(scene);
  const V y = hn::Broadcast<kLane>(w.y);
  return lerp(lerp(row(0), row(step.y), y), lerp(row(step.z), row(step.z + step.y), y),
              hn::Broadcast<kLane>(w.z));
}

template <bool kNearest>
HWY_INLINE Voxels sample(const Scene& scene, const Cell& cell) {
  HWY_ALIGN std::int32_t lower[kLinesPerBlock];
  hn::Store(cell.lower, di, lower);
  const VI above = hn::NearestInt(hn::Mul(cell.w.x, hn::Set(d, kMostWeight)));
  const VI below = hn::Sub(hn::Set(di, static_cast<std::int32_t>(kMostWeight)), above);
  const VI weights = hn::Or(below, hn::ShiftLeft<16>(above));
  const V a = values_at<kNearest, 0>(scene, lower, weights, cell.w);
  const V b = values_at<kNearest, 1>(scene, lower, weights, cell.w);
  const V c = values_at<kNearest, 2>(scene, lower, weights, cell.w);
  const V e = values_at<kNearest, 3>(scene, lower, weights, cell.w);
  // A block of four lanes by four values is transposed.
  using D64 = hn::Repartition<std::uint64_t, D>;
  const V unit = hn::Set(d, 1.0F / kMostWeight);
  const auto low = [&](V first, V second) HWY_ATTR {
    return hn::Mul(unit, hn::BitCast(d, hn::InterleaveLower(D64(), hn::BitCast(D64(), first),
                                                            hn::BitCast(D64(), second))));
  };
  const auto high = [&](V first, V second) HWY_ATTR {
    return hn::Mul(unit, hn::BitCast(d, hn::InterleaveUpper(D64(), hn::BitCast(D64(), first),
                                                            hn::BitCast(D64(), second))));
  };
  const V ab = hn::InterleaveLower(d, a, b), ce = hn::InterleaveLower(d, c, e);
  const V ab_rest = hn::InterleaveUpper(d, a, b), ce_rest = hn::InterleaveUpper(d, c, e);
  return {low(ab, ce), {high(ab, ce), low(ab_rest, ce_rest), high(ab_rest, ce_rest)}};
}

#endif

/// The recorded CT value, without the window.
HWY_INLINE V hu_at(const Scene& scene, const Cell& cell) {
  const Strides step(scene);
  const VI bytes = hn::ShiftLeft<1>(cell.lower);
  const auto along_x = [&](std::int64_t start) HWY_ATTR {
    const VI two =
        hn::GatherOffset(di, reinterpret_cast<const std::int32_t*>(scene.hu + start), bytes);
    const V low = hn::ConvertTo(d, hn::ShiftRight<16>(hn::ShiftLeft<16>(two)));
    return lerp(low, hn::ConvertTo(d, hn::ShiftRight<16>(two)), cell.w.x);
  };
  if (scene.nearest) return along_x(0);
  return lerp(lerp(along_x(0), along_x(step.y), cell.w.y),
              lerp(along_x(step.z), along_x(step.z + step.y), cell.w.y), cell.w.z);
}

HWY_INLINE V ahead(const Scene& scene, int axis, V index) {
  return hn::Min(hn::Add(index, hn::Set(d, 1.0F)), last_of(scene, axis));
}
HWY_INLINE V behind(V index) { return hn::Max(hn::Sub(index, hn::Set(d, 1.0F)), hn::Zero(d)); }

/// The recorded CT value at one point within the CT.
HWY_INLINE float hu_at(const Scene& scene, const float (&index)[3]) {
  int lower[3];
  float w[3];
  for (int axis = 0; axis < 3; ++axis) {
    const int above = scene.nearest || scene.size[axis] == 1 ? 0 : 1;
    lower[axis] = std::min(static_cast<int>(index[axis]), scene.size[axis] - 1 - above);
    w[axis] = index[axis] - static_cast<float>(lower[axis]);
  }
  const Strides step(scene);
  const std::int64_t offset =
      (lower[2] * std::int64_t{scene.size[1]} + lower[1]) * scene.size[0] + lower[0];
  const auto hu = [&](std::int64_t from) HWY_ATTR {
    return static_cast<float>(scene.hu[(offset + from) * scene.hu_step]);
  };
  if (scene.nearest) return hu(0);
  const auto between = [](float a, float b, float weight) { return a + weight * (b - a); };
  const auto along_x = [&](std::int64_t start)
                           HWY_ATTR { return between(hu(start), hu(start + step.x), w[0]); };
  return between(between(along_x(0), along_x(step.y), w[1]),
                 between(along_x(step.z), along_x(step.z + step.y), w[1]), w[2]);
}

/// One sample of the CT.
struct Point {
  float index[3];
  float hu;             // but for rounding
  float difference[3];  // of the points of its gradient, in the window
};

/// Whether a sample and the points of its gradient are free of gas. Of two points the one with less
/// CT decides; without a window the difference tells which.
HWY_INLINE bool is_free_of_gas(const Scene& scene, const Point& sample) {
  const float gas = scene.gas_hu;
  if (sample.hu < gas + 1.0F && hu_at(scene, sample.index) < gas) return false;
  for (int axis = 0; axis < 3; ++axis) {
    const float at = sample.index[axis];
    float point[3] = {sample.index[0], sample.index[1], sample.index[2]};
    point[axis] = std::max(at - 1.0F, 0.0F);
    if ((scene.windowed || sample.difference[axis] > 0.0F) && hu_at(scene, point) < gas)
      return false;
    point[axis] = std::min(at + 1.0F, static_cast<float>(scene.size[axis] - 1));
    if ((scene.windowed || sample.difference[axis] <= 0.0F) && hu_at(scene, point) < gas)
      return false;
  }
  return true;
}

/// The asked samples that are free of gas. About six are asked for at a time, since beams enter the
/// body one after the other.
HWY_NOINLINE M free_of_gas(const Scene& scene, const Index& index, V hu, const Index& difference,
                           M asked) {
  HWY_ALIGN float values[7][kLinesPerBlock];
  HWY_ALIGN float is_free[kLinesPerBlock];
  const V rows[7] = {index.x, index.y, index.z, hu, difference.x, difference.y, difference.z};
  for (int row = 0; row < 7; ++row) hn::Store(rows[row], d, values[row]);
  hn::Store(hn::IfThenElseZero(asked, hn::Set(d, 1.0F)), d, is_free);
  const auto& [x, y, z, value, dx, dy, dz] = values;
  for (std::size_t i = 0; i < hn::Lanes(d); ++i)
    if (is_free[i] != 0.0F &&
        !is_free_of_gas(scene, {{x[i], y[i], z[i]}, value[i], {dx[i], dy[i], dz[i]}}))
      is_free[i] = 0.0F;
  return hn::Ne(hn::Load(d, is_free), hn::Zero(d));
}

/// Change of mu per voxel: a difference over its span, which is 2 voxels except at the border.
HWY_INLINE V per_voxel(const Scene& scene, int axis, V index, V difference) {
  const V apart = hn::Sub(ahead(scene, axis, index), behind(index));
  const V unit = hn::Set(d, scene.difference_unit);
  return hn::Div(hn::Mul(difference, unit), hn::Max(apart, hn::Set(d, 1.0F)));
}

HWY_INLINE Index per_voxel(const Scene& scene, bool inner, const Index& index,
                           const Index& difference) {
  if (HWY_LIKELY(inner)) {
    const V half = hn::Set(d, 0.5F * scene.difference_unit);
    return {hn::Mul(difference.x, half), hn::Mul(difference.y, half), hn::Mul(difference.z, half)};
  }
  return {per_voxel(scene, 0, index.x, difference.x), per_voxel(scene, 1, index.y, difference.y),
          per_voxel(scene, 2, index.z, difference.z)};
}

/// Samples from `begin` to before `end`.
struct Range {
  float begin, end;
  HWY_INLINE bool contains(int sample) const {
    const auto n = static_cast<float>(sample);
    return begin <= n && n < end;
  }
};

/// The samples at which all beams, and the points of their gradients, are inside the CT, which is
/// convex. Samples within a thousandth of a voxel of its border do not count.
HWY_INLINE Range inner_samples(const Scene& scene, const Index& first, const Index& step) {
  const bool has_inner = std::min({scene.size[0], scene.size[1], scene.size[2]}) > 3;
  V begin = hn::Zero(d);
  V end = hn::Set(d, has_inner ? 1e9F : 0.0F);
  const V first_of[3] = {first.x, first.y, first.z};
  const V step_of[3] = {step.x, step.y, step.z};
  for (int axis = 0; axis < 3; ++axis) {
    const V low = hn::Set(d, 1.001F);
    const V high = hn::Sub(last_of(scene, axis), low);
    // A step of zero would make 0 / 0 of a beam along the border.
    const V tiny = hn::Set(d, 1e-6F);
    const V slope = hn::IfThenElse(hn::Lt(hn::Abs(step_of[axis]), tiny), tiny, step_of[axis]);
    const V to_low = hn::Div(hn::Sub(low, first_of[axis]), slope);
    const V to_high = hn::Div(hn::Sub(high, first_of[axis]), slope);
    begin = hn::Max(begin, hn::Min(to_low, to_high));
    end = hn::Min(end, hn::Max(to_low, to_high));
  }
  return {hn::GetLane(hn::MaxOfLanes(d, begin)), hn::GetLane(hn::MinOfLanes(d, end))};
}

}  // namespace
}  // namespace usct::simulated_lc2::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // guard that toggles
