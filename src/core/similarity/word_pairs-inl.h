// Loads of two words of 32 bits for each lane, from places of its own. The kernels include this
// file after hwy/foreach_target.h, once per instruction set; hence the guard that toggles.
#if defined(USCT_SIMILARITY_WORD_PAIRS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef USCT_SIMILARITY_WORD_PAIRS_INL_H_
#undef USCT_SIMILARITY_WORD_PAIRS_INL_H_
#else
#define USCT_SIMILARITY_WORD_PAIRS_INL_H_
#endif

#include <hwy/highway.h>

#include <cstdint>
#include <cstring>

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

#if HWY_TARGET != HWY_SCALAR

namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_AVX2

/// In place of gathers, which took up to twice as long as single loads where both were measured
/// (AMD Zen 3). `pair_at` loads both words of a lane, from an offset in bytes.
template <class VI, class VU, class PairAt>
HWY_INLINE void load_pairs(VI offsets, const PairAt& pair_at, VU& first, VU& second) {
  alignas(32) std::int32_t at[8];
  hn::Store(offsets, hn::DFromV<VI>(), at);
  const auto two_lanes = [&](int a, int b) HWY_ATTR {
    return _mm_unpacklo_epi64(pair_at(at[a]), pair_at(at[b]));
  };
  // Shuffles work within the halves of a vector, so that lanes come from both.
  const auto four_lanes = [&](int a, int b) HWY_ATTR {
    return _mm256_castsi256_ps(_mm256_set_m128i(two_lanes(a + 4, b + 4), two_lanes(a, b)));
  };
  const __m256 even = four_lanes(0, 1);
  const __m256 odd = four_lanes(2, 3);
  first = VU{_mm256_castps_si256(_mm256_shuffle_ps(even, odd, 0x88))};
  second = VU{_mm256_castps_si256(_mm256_shuffle_ps(even, odd, 0xDD))};
}

#endif

/// Loads the words at offsets in bytes, and their next neighbours.
template <class VI, class VU>
HWY_INLINE void load_neighbours(const std::uint32_t* words, VI offsets, VU& first, VU& second) {
#if HWY_TARGET == HWY_AVX2
  const char* const bytes = reinterpret_cast<const char*>(words);
  const auto pair_at = [&](std::int32_t at) HWY_ATTR {
    return _mm_loadl_epi64(reinterpret_cast<const __m128i*>(bytes + at));
  };
  load_pairs(offsets, pair_at, first, second);
#else
  const hn::DFromV<VU> du;
  const hn::Repartition<std::uint64_t, decltype(du)> dq;
  const hn::RebindToSigned<decltype(dq)> dqi;
  const hn::Half<hn::DFromV<VI>> di_half;
  const auto* const base = reinterpret_cast<const std::uint64_t*>(words);
  const auto loaded = [&](auto half) HWY_ATTR {
    return hn::BitCast(du, hn::GatherOffset(dq, base, hn::PromoteTo(dqi, half)));
  };
  const VU lower = loaded(hn::LowerHalf(di_half, offsets));
  const VU upper = loaded(hn::UpperHalf(di_half, offsets));
  first = hn::ConcatEven(du, upper, lower);
  second = hn::ConcatOdd(du, upper, lower);
#endif
}

/// Loads the words at the same offsets in bytes from two addresses, which need no alignment.
template <class VI, class VU>
HWY_INLINE void load_from_both(const void* one, const void* other, VI offsets, VU& first,
                               VU& second) {
#if HWY_TARGET == HWY_AVX2
  const auto word_at = [](const void* from, std::int32_t at) HWY_ATTR {
    std::int32_t word = 0;
    std::memcpy(&word, static_cast<const char*>(from) + at, sizeof word);
    return word;
  };
  const auto pair_at = [&](std::int32_t at) HWY_ATTR {
    return _mm_insert_epi32(_mm_cvtsi32_si128(word_at(one, at)), word_at(other, at), 1);
  };
  load_pairs(offsets, pair_at, first, second);
#else
  const hn::DFromV<VU> du;
  first = hn::GatherOffset(du, static_cast<const std::uint32_t*>(one), offsets);
  second = hn::GatherOffset(du, static_cast<const std::uint32_t*>(other), offsets);
#endif
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // USCT_SIMILARITY_WORD_PAIRS_INL_H_
