#include "ultrasound/row_sums.h"

#include <algorithm>

// Compiled once per instruction set; the best that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ultrasound/row_sums.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void sum_rows(const WeightedRow* rows, std::size_t row_count, std::size_t count, float* sums) {
  const hn::ScalableTag<float> d;
  const std::size_t lanes = hn::Lanes(d);
  const auto product = [&](std::size_t row, std::size_t i) HWY_ATTR {
    return hn::Mul(hn::LoadU(d, rows[row].weights + i), hn::LoadU(d, rows[row].values + i));
  };
  std::size_t i = 0;
  // Four sums at once hide the time that each addition takes.
  for (; i + 4 * lanes <= count; i += 4 * lanes) {
    auto a = hn::Zero(d);
    auto b = a;
    auto c = a;
    auto e = a;
    for (std::size_t row = 0; row < row_count; ++row) {
      a = hn::Add(a, product(row, i));
      b = hn::Add(b, product(row, i + lanes));
      c = hn::Add(c, product(row, i + 2 * lanes));
      e = hn::Add(e, product(row, i + 3 * lanes));
    }
    hn::StoreU(a, d, sums + i);
    hn::StoreU(b, d, sums + i + lanes);
    hn::StoreU(c, d, sums + i + 2 * lanes);
    hn::StoreU(e, d, sums + i + 3 * lanes);
  }
  // The last vector goes over some again where lanes do not divide the count.
  while (i < count && count >= lanes) {
    i = std::min(i, count - lanes);
    auto sum = hn::Zero(d);
    for (std::size_t row = 0; row < row_count; ++row) sum = hn::Add(sum, product(row, i));
    hn::StoreU(sum, d, sums + i);
    i += lanes;
  }
  for (; i < count; ++i) {
    float sum = 0.0F;
    for (std::size_t row = 0; row < row_count; ++row)
      sum += rows[row].weights[i] * rows[row].values[i];
    sums[i] = sum;
  }
}

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(sum_rows);

void sum_rows(const WeightedRow* rows, std::size_t row_count, std::size_t count, float* sums) {
  HWY_DYNAMIC_DISPATCH(sum_rows)(rows, row_count, count, sums);
}

}  // namespace usct
#endif
