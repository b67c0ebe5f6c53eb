#include "volume/combine_rows.h"

#include <cstdint>

// Compiled once per instruction set; the best that the machine has is chosen at run time.
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

template <typename T>
void combine(const T* const* rows, const float* weights, std::size_t row_count, std::size_t count,
             float* out) {
  const std::size_t lanes = hn::Lanes(d);
  const auto product = [&](std::size_t row, std::size_t i) HWY_ATTR {
    return hn::Mul(hn::Set(d, weights[row]), load(rows[row] + i));
  };
  std::size_t i = 0;
  // Four sums at once hide the time that each addition takes.
  for (; i + 4 * lanes <= count; i += 4 * lanes) {
    V a = hn::Zero(d), b = a, c = a, e = a;
    for (std::size_t row = 0; row < row_count; ++row) {
      a = hn::Add(a, product(row, i));
      b = hn::Add(b, product(row, i + lanes));
      c = hn::Add(c, product(row, i + 2 * lanes));
      e = hn::Add(e, product(row, i + 3 * lanes));
    }
    hn::StoreU(a, d, out + i);
    hn::StoreU(b, d, out + i + lanes);
    hn::StoreU(c, d, out + i + 2 * lanes);
    hn::StoreU(e, d, out + i + 3 * lanes);
  }
  for (; i + lanes <= count; i += lanes) {
    V sum = hn::Zero(d);
    for (std::size_t row = 0; row < row_count; ++row) sum = hn::Add(sum, product(row, i));
    hn::StoreU(sum, d, out + i);
  }
  for (; i < count; ++i) {
    float sum = 0.0F;
    for (std::size_t row = 0; row < row_count; ++row)
      sum += weights[row] * static_cast<float>(rows[row][i]);
    out[i] = sum;
  }
}

// A name for each type: what is chosen at run time cannot be a template.
#define USCT_COMBINE(name, T)                                                                     \
  void name(const T* const* rows, const float* weights, std::size_t row_count, std::size_t count, \
            float* out) {                                                                         \
    combine(rows, weights, row_count, count, out);                                                \
  }
USCT_COMBINE(combine_u8, std::uint8_t)
USCT_COMBINE(combine_i16, std::int16_t)
USCT_COMBINE(combine_u16, std::uint16_t)
USCT_COMBINE(combine_f32, float)
#undef USCT_COMBINE

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

}  // namespace usct
#endif
