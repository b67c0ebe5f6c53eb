#include "rendering/structure_fill.h"

// The file is compiled once per instruction set; the machine's best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "rendering/structure_fill.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>

HWY_BEFORE_NAMESPACE();
namespace usct::rendering::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

const hn::CappedTag<float, 16> df;
const hn::RebindToSigned<decltype(df)> d32;
const hn::Rebind<std::uint16_t, decltype(df)> d16;
const hn::Rebind<std::uint8_t, decltype(df)> d8;
using V8 = hn::Vec<decltype(d8)>;
using V16 = hn::Vec<decltype(d16)>;

/// Mixes a channel of the fill into the pixels; the weight is in [0, 256].
HWY_INLINE V8 mixed(V8 pixels, V16 weight, std::uint8_t channel) {
  const V16 kept = hn::Sub(hn::Set(d16, 256), weight);
  const V16 sum =
      hn::Add(hn::Mul(hn::PromoteTo(d16, pixels), kept), hn::Mul(hn::Set(d16, channel), weight));
  return hn::DemoteTo(d8, hn::BitCast(hn::RebindToSigned<decltype(d16)>(), hn::ShiftRight<8>(sum)));
}

/// Fills as many pixels as a vector has lanes, and returns how many of them are covered.
HWY_INLINE std::size_t fill_vector(std::uint8_t* pixels, const float* inverse, const float* first,
                                   const StructureFill& fill) {
  const auto v = hn::LoadU(df, inverse);
  const auto f = hn::LoadU(df, first);
  const auto near = hn::Mul(hn::Mul(hn::Set(df, static_cast<float>(fill.hidden_depth_mm)), f), v);
  const auto tiny = hn::Set(df, 1e-30F);  // nothing is divided by 0 where nothing is covered
  const auto most = hn::Set(df, static_cast<float>(256.0 * fill.opacity));
  const auto share = hn::Div(hn::Mul(most, near), hn::Add(hn::Add(near, hn::Sub(f, v)), tiny));
  const V16 weight = hn::DemoteTo(d16, hn::ConvertTo(d32, share));
  V8 a, b, c;
  hn::LoadInterleaved3(d8, pixels, a, b, c);
  hn::StoreInterleaved3(mixed(a, weight, fill.colour[0]), mixed(b, weight, fill.colour[1]),
                        mixed(c, weight, fill.colour[2]), d8, pixels);
  return hn::CountTrue(df, hn::Gt(v, hn::Zero(df)));
}

std::size_t fill_structure(std::uint8_t* pixels, const float* inverse, const float* first,
                           std::size_t count, const StructureFill& fill) {
  constexpr std::size_t kMostLanes = 16;
  const std::size_t lanes = hn::Lanes(df);
  std::size_t covered = 0;
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes)
    covered += fill_vector(pixels + 3 * i, inverse + i, first + i, fill);
  if (i == count) return covered;
  const std::size_t rest = count - i;
  std::uint8_t last_pixels[3 * kMostLanes] = {};
  float last_inverse[kMostLanes] = {};
  float last_first[kMostLanes] = {};
  std::copy_n(pixels + 3 * i, 3 * rest, last_pixels);
  std::copy_n(inverse + i, rest, last_inverse);
  std::copy_n(first + i, rest, last_first);
  covered += fill_vector(last_pixels, last_inverse, last_first, fill);
  std::copy_n(last_pixels, 3 * rest, pixels + 3 * i);
  return covered;
}

}  // namespace usct::rendering::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct::rendering {

HWY_EXPORT(fill_structure);

std::size_t fill_structure(std::uint8_t* pixels, const float* inverse_mm, const float* first_mm,
                           std::size_t count, const StructureFill& fill) {
  return HWY_DYNAMIC_DISPATCH(fill_structure)(pixels, inverse_mm, first_mm, count, fill);
}

}  // namespace usct::rendering
#endif
