// Vectors of unknown size cannot be members, so SVE is left out; machines that have it run NEON.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// The file is compiled once per instruction set; the machine's best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/block_kernel_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "similarity/block_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR
void block_values(const BlockMatch& match, std::uint8_t* values) {
  block_values_scalar(match, values);
}
void add_blocks(const BlockSum& sum) { add_blocks_scalar(sum); }
#else

constexpr hn::CappedTag<float, kBlockLanes> dvalue;
constexpr hn::RebindToSigned<decltype(dvalue)> dsum;
constexpr hn::RebindToUnsigned<decltype(dvalue)> dword;
constexpr hn::Repartition<std::int16_t, decltype(dsum)> dhalf;
constexpr hn::Rebind<std::uint8_t, decltype(dvalue)> dbyte;
using VValue = hn::Vec<decltype(dvalue)>;
using VSum = hn::Vec<decltype(dsum)>;
using VHalf = hn::Vec<decltype(dhalf)>;

/// So many rows of translations are compared at once: they share most of what is loaded of the CT.
/// Their sums and a slice of the block stay in registers, of which wide vectors have more.
constexpr std::size_t kRowsAtOnce = hn::MaxLanes(dvalue) == kBlockLanes ? 5 : 3;

/// A sum of products of the halves of words. Instructions may split it in two.
struct Products {
  VSum sum, rest;

  HWY_INLINE void add(VHalf ultrasound, VHalf ct) {
    sum = hn::ReorderWidenMulAccumulate(dsum, ultrasound, ct, sum, rest);
  }
  HWY_INLINE VValue value() const {
    return hn::Mul(hn::ConvertTo(dvalue, hn::RearrangeToOddPlusEven(sum, rest)),
                   hn::Set(dvalue, 1.0F / kBlockNorm));
  }
};

/// Two neighbouring numbers in each word.
HWY_INLINE VHalf both(const std::int16_t* numbers) {
  std::uint32_t word = 0;
  std::memcpy(&word, numbers, sizeof word);
  return hn::BitCast(dhalf, hn::Set(dword, word));
}

HWY_INLINE VHalf load(const std::vector<std::uint32_t>& words, std::size_t place) {
  return hn::BitCast(dhalf, hn::LoadU(dword, words.data() + place));
}

/// The values of a vector of translations by its products with value and gradient.
HWY_INLINE void write(const BlockMatch& match, std::size_t place, VValue value, VValue gradient,
                      std::uint8_t* values) {
  const LatticeCt& ct = match.ct;
  const VValue twice =
      hn::Mul(hn::Set(dvalue, 2.0F), hn::LoadU(dvalue, ct.inverse_vg.data() + place));
  const VValue first =
      hn::MulAdd(hn::LoadU(dvalue, ct.inverse_vv.data() + place), value, hn::Mul(twice, gradient));
  const VValue second = hn::Mul(hn::LoadU(dvalue, ct.inverse_gg.data() + place), gradient);
  const VValue explained = hn::MulAdd(first, value, hn::Mul(second, gradient));
  const VValue most = hn::Set(dvalue, std::min(kPartsOfCell * match.known, 255.0F));
  const VValue parts = hn::Min(hn::Mul(explained, hn::Set(dvalue, kPartsOfCell)), most);
  hn::StoreU(hn::DemoteTo(dbyte, hn::NearestInt(parts)), dbyte, values);
}

/// The values of a vector of translations along x, in so many rows, from a point of the lattice on.
template <std::size_t kRows>
HWY_INLINE void write_values(const BlockMatch& match, std::size_t place, std::uint8_t* values) {
  const LatticeCt& ct = match.ct;
  const auto row = static_cast<std::size_t>(ct.size.x());
  const std::size_t slice = row * static_cast<std::size_t>(ct.size.y());
  Products value[kRows];
  Products gradient[kRows];
  for (std::size_t r = 0; r < kRows; ++r)
    value[r].sum = value[r].rest = gradient[r].sum = gradient[r].rest = hn::Zero(dsum);
  for (std::size_t k = 0; k < kBlockEdge; ++k)
    for (std::size_t i = 0; i < kBlockEdge; i += 2) {
      const std::int16_t* const of_block = &match.ultrasound[kBlockEdge * kBlockEdge * k + i];
      const std::size_t at = place + k * slice + i;
      VHalf u[kBlockEdge];
      for (std::size_t j = 0; j < kBlockEdge; ++j) u[j] = both(of_block + kBlockEdge * j);
      for (std::size_t j = 0; j < kRows + kBlockEdge - 1; ++j) {
        const VHalf of_value = load(ct.value, at + j * row);
        const VHalf of_gradient = load(ct.gradient, at + j * row);
        for (std::size_t r = 0; r < kRows; ++r)
          if (r <= j && j < r + kBlockEdge) {
            value[r].add(u[j - r], of_value);
            gradient[r].add(u[j - r], of_gradient);
          }
      }
    }
  const std::size_t values_row = whole_vectors(match.translations.x());
  for (std::size_t r = 0; r < kRows; ++r)
    write(match, place + r * row, value[r].value(), gradient[r].value(), values + r * values_row);
}

/// All translations along y at one of z, and of so many along x.
template <std::size_t kRows>
HWY_INLINE void write_slice(const BlockMatch& match, int x, int z, std::uint8_t* values) {
  const int rows = match.translations.y();
  for (int next = 0; next < rows; next += kRows) {
    const int y = std::min(next, rows - static_cast<int>(kRows));
    write_values<kRows>(
        match, match.ct.place(match.first + Eigen::Vector3i(x, y, z)),
        values + static_cast<std::size_t>(y) * whole_vectors(match.translations.x()));
  }
}

void block_values(const BlockMatch& match, std::uint8_t* values) {
  const auto row = static_cast<int>(whole_vectors(match.translations.x()));
  const int rows = match.translations.y();
  for (int z = 0; z < match.translations.z(); ++z, values += rows * row)
    for (int x = 0; x < row; x += static_cast<int>(hn::Lanes(dvalue)))
      if (rows < static_cast<int>(kRowsAtOnce))
        write_slice<1>(match, x, z, values + x);
      else
        write_slice<kRowsAtOnce>(match, x, z, values + x);
}

void add_blocks(const BlockSum& sum) {
  constexpr hn::CappedTag<std::uint16_t, kBlockLanes> dtotal;
  constexpr hn::Rebind<std::uint8_t, decltype(dtotal)> dadded;
  const std::size_t row = whole_vectors(sum.size.x());
  std::uint16_t* sums = sum.sums;
  for (int z = 0; z < sum.size.z(); ++z)
    for (int y = 0; y < sum.size.y(); ++y, sums += row) {
      const std::uint8_t* rows[kBlocksAdded];
      for (std::size_t b = 0; b < kBlocksAdded; ++b) rows[b] = sum.blocks[b].from({0, y, z}).first;
      for (std::size_t x = 0; x < row; x += hn::Lanes(dtotal)) {
        auto total = hn::LoadU(dtotal, sums + x);
        for (const std::uint8_t* values : rows)
          total = hn::SaturatedAdd(total, hn::PromoteTo(dtotal, hn::LoadU(dadded, values + x)));
        hn::StoreU(total, dtotal, sums + x);
      }
    }
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(block_values);
HWY_EXPORT(add_blocks);

void block_values_simd(const BlockMatch& match, std::uint8_t* values) {
  HWY_DYNAMIC_DISPATCH(block_values)(match, values);
}

void add_blocks_simd(const BlockSum& sum) { HWY_DYNAMIC_DISPATCH(add_blocks)(sum); }

}  // namespace usct
#endif
