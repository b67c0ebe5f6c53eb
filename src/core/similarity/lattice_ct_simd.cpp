// Vectors of unknown size cannot be members, so SVE is left out; machines that have it run NEON.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// The file is compiled once per instruction set; the machine's best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/lattice_ct_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <array>

#include "similarity/byte_products-inl.h"
#include "similarity/word_pairs-inl.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR
void sample_row(const LatticeRow& row, int count, std::uint32_t* value, std::uint32_t* gradient) {
  sample_row_scalar(row, count, value, gradient);
}
void invert_covariances(LatticeCt& ct, const Ridges& ridges) {
  invert_covariances_scalar(ct, ridges);
}
#else

/// The words at the corners of cells; the digits are i and k.
struct CornerWords {
  VWord w00, w10, w01, w11;
};

template <int kByte>
HWY_INLINE VValue byte(VWord word) {
  const VWord shifted = hn::ShiftRight<8 * kByte>(word);
  return hn::ConvertTo(dvalue, hn::BitCast(dsum, hn::And(shifted, hn::Set(dword, 0xFFU))));
}

HWY_INLINE VValue between(VValue a, VValue b, VValue t) { return hn::MulAdd(t, hn::Sub(b, a), a); }

/// A byte of the words, interpolated along i and k.
template <int kByte>
HWY_INLINE VValue on_edge(const CornerWords& words, VValue ti, VValue tk) {
  return between(between(byte<kByte>(words.w00), byte<kByte>(words.w10), ti),
                 between(byte<kByte>(words.w01), byte<kByte>(words.w11), ti), tk);
}

HWY_INLINE VWord rounded(VValue steps) { return hn::BitCast(dword, hn::NearestInt(steps)); }

/// Samples the points of a vector, without their neighbours.
HWY_INLINE void sample(const LatticeRow& row, VValue number, std::uint32_t* value,
                       std::uint32_t* gradient) {
  VValue at[3];
  hn::Mask<decltype(dvalue)> inside = hn::Eq(number, number);
  for (int axis = 0; axis < 3; ++axis) {
    at[axis] =
        hn::MulAdd(number, hn::Set(dvalue, row.step[axis]), hn::Set(dvalue, row.first[axis]));
    inside = hn::And(inside, hn::And(hn::Ge(at[axis], hn::Zero(dvalue)),
                                     hn::Lt(at[axis], hn::Set(dvalue, row.cells[axis]))));
  }
  VSum cell[3];
  for (int axis = 0; axis < 3; ++axis) {
    at[axis] = hn::IfThenElseZero(inside, at[axis]);
    cell[axis] = hn::ConvertTo(dsum, at[axis]);
    at[axis] = hn::Sub(at[axis], hn::ConvertTo(dvalue, cell[axis]));
  }
  const VSum first = hn::Add(cell[0], hn::Add(hn::Mul(cell[1], hn::Set(dsum, row.stride_j)),
                                              hn::Mul(cell[2], hn::Set(dsum, row.stride_k))));
  const VSum bytes = hn::ShiftLeft<2>(first);
  CornerWords words;
  load_neighbours(row.words, bytes, words.w00, words.w10);
  load_neighbours(row.words + row.stride_k, bytes, words.w01, words.w11);
  const VValue ct =
      between(on_edge<0>(words, at[0], at[2]), on_edge<1>(words, at[0], at[2]), at[1]);
  const VValue change =
      between(on_edge<2>(words, at[0], at[2]), on_edge<3>(words, at[0], at[2]), at[1]);
  const VValue known = hn::IfThenElse(inside, ct, hn::Set(dvalue, row.background));
  hn::StoreU(rounded(known), dword, value);
  hn::StoreU(rounded(hn::IfThenElseZero(inside, change)), dword, gradient);
}

/// Puts the next neighbours of each point beside it. Those behind are alone in their words yet.
HWY_INLINE void add_neighbours(std::uint32_t* words) {
  static_assert(kBlockEdge == 4, "a word holds the edge of a block");
  const VWord pair = hn::Or(hn::LoadU(dword, words), hn::ShiftLeft<8>(hn::LoadU(dword, words + 1)));
  const VWord next =
      hn::Or(hn::LoadU(dword, words + 2), hn::ShiftLeft<8>(hn::LoadU(dword, words + 3)));
  hn::StoreU(hn::Or(pair, hn::ShiftLeft<16>(next)), dword, words);
}

void sample_row(const LatticeRow& row, int count, std::uint32_t* value, std::uint32_t* gradient) {
  const auto lanes = static_cast<int>(hn::Lanes(dvalue));
  for (int i = 0; i < count; i += lanes)
    sample(row, hn::Iota(dvalue, static_cast<float>(i)), value + i, gradient + i);
  for (int i = 0; i < count; i += lanes) {
    add_neighbours(value + i);
    add_neighbours(gradient + i);
  }
}

/// Sums of value, gradient and their products over edges, squares or cubes of kBlockEdge points
/// that begin at each point of a slice; undefined where they do not lie within the lattice.
enum Sum { kValue, kGradient, kValueSquared, kBoth, kGradientSquared, kSums };
using SliceSums = std::array<std::vector<std::int32_t>, kSums>;

/// Sums over the edges along i, each of which is a word.
HWY_INLINE void sum_edges(VWord value, VWord gradient, std::size_t place, SliceSums& sums) {
  const VHalf v[2] = {even_bytes(value), odd_bytes(value)};
  const VHalf g[2] = {even_bytes(gradient), odd_bytes(gradient)};
  const VHalf one = hn::Set(dhalf, std::int16_t{1});
  Products products[kSums];
  for (int half = 0; half < 2; ++half) {
    products[kValue].add(v[half], one);
    products[kGradient].add(g[half], one);
    products[kValueSquared].add(v[half], v[half]);
    products[kBoth].add(v[half], g[half]);
    products[kGradientSquared].add(g[half], g[half]);
  }
  for (std::size_t sum = 0; sum < kSums; ++sum)
    hn::StoreU(products[sum].total(), dsum, sums[sum].data() + place);
}

/// The sum of as many numbers as a block has along an edge.
HWY_INLINE VSum sum_of(const std::int32_t* a, const std::int32_t* b, const std::int32_t* c,
                       const std::int32_t* d) {
  return hn::Add(hn::Add(hn::LoadU(dsum, a), hn::LoadU(dsum, b)),
                 hn::Add(hn::LoadU(dsum, c), hn::LoadU(dsum, d)));
}

HWY_INLINE VValue mean_of(VSum sum) {
  constexpr float kShare = 1.0F / (kBlockEdge * kBlockEdge * kBlockEdge);
  return hn::Mul(hn::ConvertTo(dvalue, sum), hn::Set(dvalue, kShare));
}

HWY_INLINE void write_inverses(const VSum (&sums)[kSums], const Ridges& ridges, std::size_t place,
                               LatticeCt& ct) {
  const VValue v = mean_of(sums[kValue]);
  const VValue g = mean_of(sums[kGradient]);
  const VValue vv =
      hn::Add(hn::NegMulAdd(v, v, mean_of(sums[kValueSquared])), hn::Set(dvalue, ridges.value));
  const VValue gg = hn::Add(hn::NegMulAdd(g, g, mean_of(sums[kGradientSquared])),
                            hn::Set(dvalue, ridges.gradient));
  const VValue vg = hn::NegMulAdd(v, g, mean_of(sums[kBoth]));
  const VValue product = hn::Mul(vv, gg);
  const VValue determinant =
      hn::Max(hn::NegMulAdd(vg, vg, product), hn::Mul(product, hn::Set(dvalue, kLeastDeterminant)));
  const VValue scale = hn::Div(hn::Set(dvalue, 1.0F), determinant);
  hn::StoreU(hn::Mul(gg, scale), dvalue, ct.inverse_vv.data() + place);
  hn::StoreU(hn::Neg(hn::Mul(vg, scale)), dvalue, ct.inverse_vg.data() + place);
  hn::StoreU(hn::Mul(vv, scale), dvalue, ct.inverse_gg.data() + place);
}

/// Slice by slice, so that all that is read and written stays in the cache.
void invert_covariances(LatticeCt& ct, const Ridges& ridges) {
  for (LargeVector<float>* inverse : {&ct.inverse_vv, &ct.inverse_vg, &ct.inverse_gg})
    inverse->resize(ct.value.size());
  const auto row = static_cast<std::size_t>(ct.size.x());
  const std::size_t slice = ct.place({0, 0, 1});
  const std::size_t lanes = hn::Lanes(dvalue);
  SliceSums edges;
  std::array<SliceSums, kBlockEdge> squares;  // of the last slices, in turn
  for (std::size_t sum = 0; sum < kSums; ++sum) {
    edges[sum].resize(slice + kBlockLanes + (kBlockEdge - 1) * row);
    for (SliceSums& of_slice : squares) of_slice[sum].resize(slice + kBlockLanes);
  }
  for (std::size_t k = 0; k < static_cast<std::size_t>(ct.size.z()); ++k) {
    for (std::size_t i = 0; i < slice; i += lanes)
      sum_edges(hn::LoadU(dword, ct.value.data() + k * slice + i),
                hn::LoadU(dword, ct.gradient.data() + k * slice + i), i, edges);
    for (std::size_t sum = 0; sum < kSums; ++sum)
      for (std::size_t i = 0; i < slice; i += lanes) {
        const std::int32_t* at = edges[sum].data() + i;
        hn::StoreU(sum_of(at, at + row, at + 2 * row, at + 3 * row), dsum,
                   squares[k % kBlockEdge][sum].data() + i);
      }
    if (k + 1 < kBlockEdge) continue;
    for (std::size_t i = 0; i < slice; i += lanes) {
      VSum sums[kSums];
      for (std::size_t sum = 0; sum < kSums; ++sum)
        sums[sum] = sum_of(squares[0][sum].data() + i, squares[1][sum].data() + i,
                           squares[2][sum].data() + i, squares[3][sum].data() + i);
      write_inverses(sums, ridges, (k + 1 - kBlockEdge) * slice + i, ct);
    }
  }
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(sample_row);
HWY_EXPORT(invert_covariances);

void sample_row_simd(const LatticeRow& row, int count, std::uint32_t* value,
                     std::uint32_t* gradient) {
  HWY_DYNAMIC_DISPATCH(sample_row)(row, count, value, gradient);
}

void invert_covariances_simd(LatticeCt& ct, const Ridges& ridges) {
  HWY_DYNAMIC_DISPATCH(invert_covariances)(ct, ridges);
}

}  // namespace usct
#endif
