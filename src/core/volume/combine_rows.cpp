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

template <typename T>
void combine(const Uniform<T>& rows, std::size_t row_count, std::size_t count, float* out) {
  const std::size_t lanes = hn::Lanes(d);
  std::size_t i = 0;
  // Four independent sums hide the latency of the additions. If they do not divide the count, the
  // last four compute some sums a second time, as the last vector below does.
  while (i < count && count >= 4 * lanes) {
    i = std::min(i, count - 4 * lanes);
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
    i += 4 * lanes;
  }
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

void sum_tables(const std::vector<RowRange>& ranges, const float* weights, std::size_t at,
                std::size_t tables, TableRows<const float> in, TableRows<float> out) {
  const hn::CappedTag<float, kRowPart> dp;
  for (std::size_t first = 0; first < tables; first += 4)
    for (std::size_t i = at; i < at + kRowPart; i += hn::Lanes(dp)) {
      // Four independent sums; if fewer tables are left, some are of the last one again.
      const auto table = [&](std::size_t n) { return std::min(first + n, tables - 1); };
      const float* const in_a = in.tables[table(0)] + i;
      const float* const in_b = in.tables[table(1)] + i;
      const float* const in_c = in.tables[table(2)] + i;
      const float* const in_e = in.tables[table(3)] + i;
      std::size_t to = 0;
      for (const RowRange& range : ranges) {
        auto a = hn::Zero(dp), b = a, c = a, e = a;
        const float* weight = weights + range.first_weight + (i - at);
        std::size_t from = range.first_row * in.row_stride;
        for (std::size_t row = 0; row < range.rows; ++row) {
          const auto w = hn::LoadU(dp, weight);
          a = hn::Add(a, hn::Mul(w, hn::LoadU(dp, in_a + from)));
          b = hn::Add(b, hn::Mul(w, hn::LoadU(dp, in_b + from)));
          c = hn::Add(c, hn::Mul(w, hn::LoadU(dp, in_c + from)));
          e = hn::Add(e, hn::Mul(w, hn::LoadU(dp, in_e + from)));
          weight += kRowPart;
          from += in.row_stride;
        }
        hn::StoreU(a, dp, out.tables[table(0)] + to + i);
        hn::StoreU(b, dp, out.tables[table(1)] + to + i);
        hn::StoreU(c, dp, out.tables[table(2)] + to + i);
        hn::StoreU(e, dp, out.tables[table(3)] + to + i);
        to += out.row_stride;
      }
    }
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

HWY_EXPORT(sum_tables);
void combine_tables(const std::vector<RowRange>& ranges, const float* weights, std::size_t at,
                    std::size_t tables, TableRows<const float> in, TableRows<float> out) {
  HWY_DYNAMIC_DISPATCH(sum_tables)(ranges, weights, at, tables, in, out);
}

}  // namespace usct
#endif
