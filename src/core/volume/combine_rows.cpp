#include "volume/combine_rows.h"

#include <algorithm>
#include <cstdint>

// Highway compiles this file once per instruction set and chooses the best one at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "volume/combine_rows.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

const hn::ScalableTag<float> d;
using V = hn::Vec<decltype(d)>;

template <typename T>
HWY_INLINE V load(const T* values) {
  const hn::RebindToSigned<decltype(d)> di;
  return hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(hn::Rebind<T, decltype(d)>(), values)));
}
HWY_INLINE V load(const float* values) { return hn::LoadU(d, values); }

/// Rows with one weight each.
template <typename T>
struct Uniform {
  const T* const* rows;
  const float* weights;

  HWY_INLINE V products(std::size_t row, std::size_t i) const {
    return hn::Mul(hn::Set(d, weights[row]), load(rows[row] + i));
  }
  float product(std::size_t row, std::size_t i) const {
    return weights[row] * static_cast<float>(rows[row][i]);
  }
};

/// Rows with a weight for each value.
struct Weighted {
  const WeightedRow* rows;

  HWY_INLINE V products(std::size_t row, std::size_t i) const {
    return hn::Mul(load(rows[row].weights + i), load(rows[row].values + i));
  }
  float product(std::size_t row, std::size_t i) const {
    return rows[row].weights[i] * rows[row].values[i];
  }
};

template <typename Rows>
void combine(const Rows& rows, std::size_t row_count, std::size_t count, float* out) {
  const std::size_t lanes = hn::Lanes(d);
  std::size_t i = 0;
  // Four independent sums hide the latency of the additions.
  for (; i + 4 * lanes <= count; i += 4 * lanes) {
    V a = hn::Zero(d), b = a, c = a, e = a;
    for (std::size_t row = 0; row < row_count; ++row) {
      a = hn::Add(a, rows.products(row, i));
      b = hn::Add(b, rows.products(row, i + lanes));
      c = hn::Add(c, rows.products(row, i + 2 * lanes));
      e = hn::Add(e, rows.products(row, i + 3 * lanes));
    }
    hn::StoreU(a, d, out + i);
    hn::StoreU(b, d, out + i + lanes);
    hn::StoreU(c, d, out + i + 2 * lanes);
    hn::StoreU(e, d, out + i + 3 * lanes);
  }
  // If the lanes do not divide the count, the last vector computes some sums a second time.
  while (i < count && count >= lanes) {
    i = std::min(i, count - lanes);
    V sum = hn::Zero(d);
    for (std::size_t row = 0; row < row_count; ++row) sum = hn::Add(sum, rows.products(row, i));
    hn::StoreU(sum, d, out + i);
    i += lanes;
  }
  for (; i < count; ++i) {
    float sum = 0.0F;
    for (std::size_t row = 0; row < row_count; ++row) sum += rows.product(row, i);
    out[i] = sum;
  }
}

// Highway dispatches only to functions, not to templates: each type of voxel needs a name.
#define USCT_COMBINE(name, T)                                                                     \
  void name(const T* const* rows, const float* weights, std::size_t row_count, std::size_t count, \
            float* out) {                                                                         \
    combine(Uniform<T>{rows, weights}, row_count, count, out);                                    \
  }
USCT_COMBINE(combine_u8, std::uint8_t)
USCT_COMBINE(combine_i16, std::int16_t)
USCT_COMBINE(combine_u16, std::uint16_t)
USCT_COMBINE(combine_f32, float)
#undef USCT_COMBINE

void combine_weighted(const WeightedRow* rows, std::size_t row_count, std::size_t count,
                      float* out) {
  combine(Weighted{rows}, row_count, count, out);
}

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

#define USCT_DISPATCH(name, T)                                                         \
  HWY_EXPORT(name);                                                                    \
  template <>                                                                          \
  void combine_rows(const T* const* rows, const float* weights, std::size_t row_count, \
                    std::size_t count, float* out) {                                   \
    HWY_DYNAMIC_DISPATCH(name)(rows, weights, row_count, count, out);                  \
  }
USCT_DISPATCH(combine_u8, std::uint8_t)
USCT_DISPATCH(combine_i16, std::int16_t)
USCT_DISPATCH(combine_u16, std::uint16_t)
USCT_DISPATCH(combine_f32, float)
#undef USCT_DISPATCH

HWY_EXPORT(combine_weighted);
void combine_rows(const WeightedRow* rows, std::size_t row_count, std::size_t count, float* out) {
  HWY_DYNAMIC_DISPATCH(combine_weighted)(rows, row_count, count, out);
}

}  // namespace usct
#endif
