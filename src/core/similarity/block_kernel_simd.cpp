// Vectors of unknown size cannot be members, so SVE is left out; machines that have it run NEON.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// The file is compiled once per instruction set; the machine's best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/block_kernel_simd.cpp"
#define HWY_WANT_AVX3_DL         // an instruction for products of bytes
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "similarity/block_kernel.h"
#include "similarity/byte_products-inl.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR
void block_values(const BlockMatch& match, std::uint8_t* values) {
  block_values_scalar(match, values);
}
void add_blocks(const BlockSum& sum) { add_blocks_scalar(sum); }
#else

constexpr hn::Rebind<std::uint8_t, decltype(dvalue)> dbyte;

/// The edge of a block in all words.
HWY_INLINE VWord edge(const std::int8_t* cells) {
  std::uint32_t word = 0;
  std::memcpy(&word, cells, sizeof word);
  return hn::Set(dword, word);
}

/// A sum of products of the bytes of CT and ultrasound.
#if HWY_TARGET == HWY_AVX3_DL
constexpr int kSlicesUnrolled = kBlockEdge;  // registers hold the sums only then
class EdgeProducts {
 public:
  HWY_INLINE EdgeProducts() : sum_(hn::Zero(dsum)) {}
  HWY_INLINE void add(VWord ct, VWord ultrasound) {
    // Highway 1.0 has no name for it, and does not let compilers use the intrinsic function.
    asm("vpdpbusd %2, %1, %0" : "+v"(sum_.raw) : "v"(ct.raw), "v"(ultrasound.raw));
  }
  HWY_INLINE void end_slice() {}
  HWY_INLINE VSum total() const { return sum_; }

 private:
  VSum sum_;
};
#else
constexpr int kSlicesUnrolled = 1;
class EdgeProducts {
 public:
  HWY_INLINE EdgeProducts() : slice_(hn::Zero(dhalf)) {}
  HWY_INLINE void add(VWord ct, VWord ultrasound) {
    // It never saturates. Compilers reorder plain sums, and run out of registers then.
    slice_ = hn::SaturatedAdd(slice_, pairs_of_products(ct, ultrasound));
  }
  HWY_INLINE void end_slice() {
    products_.add(slice_, hn::Set(dhalf, std::int16_t{1}));
    slice_ = hn::Zero(dhalf);
  }
  HWY_INLINE VSum total() const { return products_.total(); }

 private:
  VHalf slice_;
  Products products_;
};
#endif

/// So many rows of translations are compared at once: they share most of what is loaded of the CT.
/// Their sums and a slice of the block stay in registers.
constexpr int kRowsAtOnce = 5;

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
  const VValue most = hn::Set(dvalue, std::min(kPartsOfCell * match.ultrasound.known, 255.0F));
  const VValue parts = hn::Min(hn::Mul(explained, hn::Set(dvalue, kPartsOfCell)), most);
  hn::StoreU(hn::DemoteTo(dbyte, hn::NearestInt(parts)), dbyte, values);
}

/// The sums for a vector of translations along x, in so many rows, of the block with the words of
/// the CT from a point of the lattice on.
template <std::size_t kRows, std::size_t kStride>
HWY_INLINE void add_products(const BlockMatch& match, const std::uint32_t* ct,
                             EdgeProducts (&sums)[kRows]) {
  const auto row = static_cast<std::size_t>(match.ct.size.x());
  const std::size_t slice = row * static_cast<std::size_t>(match.ct.size.y());
  const std::int8_t* cells = match.ultrasound.cells.data();
#pragma GCC unroll kSlicesUnrolled
  for (std::size_t k = 0; k < kBlockEdge; ++k, ct += slice, cells += kBlockEdge * kBlockEdge) {
    VWord u[kBlockEdge];
    for (std::size_t j = 0; j < kBlockEdge; ++j) u[j] = edge(cells + kBlockEdge * j);
#pragma GCC unroll 16
    for (std::size_t j = 0; j < kStride * (kRows - 1) + kBlockEdge; ++j) {
      const VWord words = hn::LoadU(dword, ct + j * row);
#pragma GCC unroll 16
      for (std::size_t r = 0; r < kRows; ++r)
        if (kStride * r <= j && j < kStride * r + kBlockEdge)
          sums[r].add(words, u[j - kStride * r]);
    }
    for (EdgeProducts& sum : sums) sum.end_slice();
  }
}

/// The values of a vector of translations along x, in so many rows, from a point of the lattice on.
template <std::size_t kRows, std::size_t kStride>
HWY_INLINE void write_values(const BlockMatch& match, std::size_t place, std::uint8_t* values) {
  EdgeProducts value[kRows];
  EdgeProducts gradient[kRows];
  add_products<kRows, kStride>(match, match.ct.value.data() + place, value);
  add_products<kRows, kStride>(match, match.ct.gradient.data() + place, gradient);
  const VValue scale = hn::Set(dvalue, 1.0F / match.ultrasound.norm);
  const auto scaled = [&](const EdgeProducts& products) {
    return hn::Mul(hn::ConvertTo(dvalue, products.total()), scale);
  };
  const auto row = static_cast<std::size_t>(match.ct.size.x());
  const std::size_t values_row = whole_vectors(match.translations.x());
  for (std::size_t r = 0; r < kRows; ++r)
    write(match, place + kStride * r * row, scaled(value[r]), scaled(gradient[r]),
          values + r * values_row);
}

/// All translations along y at one of z, and of so many along x.
template <std::size_t kRows, std::size_t kStride>
HWY_INLINE void write_slice(const BlockMatch& match, int x, int z, std::uint8_t* values) {
  const int rows = match.translations.y();
  for (int next = 0; next < rows; next += kRows) {
    const int y = std::min(next, rows - static_cast<int>(kRows));
    write_values<kRows, kStride>(
        match, match.place({x, y, z}),
        values + static_cast<std::size_t>(y) * whole_vectors(match.translations.x()));
  }
}

void block_values(const BlockMatch& match, std::uint8_t* values) {
  constexpr int kFewRows = 3;  // of a place and its neighbours
  const auto row = static_cast<int>(whole_vectors(match.translations.x()));
  const int rows = match.translations.y();
  for (int z = 0; z < match.translations.z(); ++z, values += rows * row)
    for (int x = 0; x < match.translations.x(); x += static_cast<int>(hn::Lanes(dvalue)))
      if (match.stride == 1 && rows >= kRowsAtOnce)
        write_slice<kRowsAtOnce, 1>(match, x, z, values + x);
      else if (match.stride == 1 && rows >= kFewRows)
        write_slice<kFewRows, 1>(match, x, z, values + x);
      else if (match.stride == 2 && rows >= kRowsAtOnce)
        write_slice<kRowsAtOnce, 2>(match, x, z, values + x);
      else
        write_slice<1, 1>(match, x, z, values + x);
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
