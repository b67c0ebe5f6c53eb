// Sums of products of bytes, four in a word, for all lanes at once. The kernels include this file
// after hwy/foreach_target.h, once per instruction set; hence the guard that toggles.
#if defined(USCT_SIMILARITY_BYTE_PRODUCTS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef USCT_SIMILARITY_BYTE_PRODUCTS_INL_H_
#undef USCT_SIMILARITY_BYTE_PRODUCTS_INL_H_
#else
#define USCT_SIMILARITY_BYTE_PRODUCTS_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>

#include "similarity/lattice_ct.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

#if HWY_TARGET != HWY_SCALAR

namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::CappedTag<float, kBlockLanes> dvalue;
constexpr hn::RebindToSigned<decltype(dvalue)> dsum;
constexpr hn::RebindToUnsigned<decltype(dvalue)> dword;
constexpr hn::Repartition<std::int16_t, decltype(dsum)> dhalf;
constexpr hn::Repartition<std::uint16_t, decltype(dsum)> dpair;
using VValue = hn::Vec<decltype(dvalue)>;
using VSum = hn::Vec<decltype(dsum)>;
using VWord = hn::Vec<decltype(dword)>;
using VHalf = hn::Vec<decltype(dhalf)>;

/// Half of the bytes of each word, as numbers of 16 bits: the first and third, or the second and
/// fourth.
HWY_INLINE VHalf even_bytes(VWord words) {
  return hn::BitCast(dhalf, hn::And(words, hn::Set(dword, 0x00FF00FFU)));
}
HWY_INLINE VHalf odd_bytes(VWord words) {
  return hn::BitCast(dhalf, hn::ShiftRight<8>(hn::BitCast(dpair, words)));
}

/// A sum of products of the halves of words. Instructions may split it in two.
struct Products {
  VSum sum, rest;

  HWY_INLINE Products() : sum(hn::Zero(dsum)), rest(hn::Zero(dsum)) {}
  HWY_INLINE void add(VHalf a, VHalf b) {
    sum = hn::ReorderWidenMulAccumulate(dsum, a, b, sum, rest);
  }
  HWY_INLINE VSum total() const { return hn::RearrangeToOddPlusEven(sum, rest); }
};

/// The sums, two by two, of the products of the bytes of words with signed bytes. They must not
/// exceed 16 bits.
HWY_INLINE VHalf pairs_of_products(VWord words, VWord signed_words) {
#if HWY_TARGET == HWY_AVX3
  return VHalf{_mm512_maddubs_epi16(words.raw, signed_words.raw)};
#elif HWY_TARGET == HWY_AVX2
  return VHalf{_mm256_maddubs_epi16(words.raw, signed_words.raw)};
#elif HWY_TARGET == HWY_SSE4 || HWY_TARGET == HWY_SSSE3
  return VHalf{_mm_maddubs_epi16(words.raw, signed_words.raw)};
#else
  const VHalf pairs = hn::BitCast(dhalf, signed_words);
  return hn::Add(hn::Mul(even_bytes(words), hn::ShiftRight<8>(hn::ShiftLeft<8>(pairs))),
                 hn::Mul(odd_bytes(words), hn::ShiftRight<8>(pairs)));
#endif
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // USCT_SIMILARITY_BYTE_PRODUCTS_INL_H_
