#include "ultrasound/square_roots.h"

#include <cmath>

// Highway compiles this file once per instruction set and chooses the best one at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ultrasound/square_roots.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void square_roots(float* values, std::size_t count) {
  const hn::ScalableTag<float> d;
  std::size_t i = 0;
  for (; i + hn::Lanes(d) <= count; i += hn::Lanes(d))
    hn::StoreU(hn::Sqrt(hn::LoadU(d, values + i)), d, values + i);
  for (; i < count; ++i) values[i] = std::sqrt(values[i]);
}

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(square_roots);
void take_square_roots(float* values, std::size_t count) {
  HWY_DYNAMIC_DISPATCH(square_roots)(values, count);
}

}  // namespace usct
#endif
