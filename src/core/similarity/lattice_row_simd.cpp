// Vectors of unknown size cannot be members, so SVE is left out; machines that have it run NEON.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// The file is compiled once per instruction set; the machine's best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/lattice_row_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "similarity/lattice_ct.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR
void sample_row(const LatticeRow& row, int count, std::uint32_t* value, std::uint32_t* gradient) {
  sample_row_scalar(row, count, value, gradient);
}
#else

constexpr hn::CappedTag<float, kBlockLanes> dpoint;
constexpr hn::RebindToSigned<decltype(dpoint)> dindex;
constexpr hn::RebindToUnsigned<decltype(dpoint)> dword;
using VPoint = hn::Vec<decltype(dpoint)>;
using VIndex = hn::Vec<decltype(dindex)>;
using VWord = hn::Vec<decltype(dword)>;

/// The words at the corners of cells; the digits are i and k.
struct CornerWords {
  VWord w00, w10, w01, w11;
};

template <int kByte>
HWY_INLINE VPoint byte(VWord word) {
  const VWord shifted = hn::ShiftRight<8 * kByte>(word);
  return hn::ConvertTo(dpoint, hn::BitCast(dindex, hn::And(shifted, hn::Set(dword, 0xFFU))));
}

HWY_INLINE VPoint between(VPoint a, VPoint b, VPoint t) { return hn::MulAdd(t, hn::Sub(b, a), a); }

/// A byte of the words, interpolated along i and k.
template <int kByte>
HWY_INLINE VPoint on_edge(const CornerWords& words, VPoint ti, VPoint tk) {
  return between(between(byte<kByte>(words.w00), byte<kByte>(words.w10), ti),
                 between(byte<kByte>(words.w01), byte<kByte>(words.w11), ti), tk);
}

HWY_INLINE VWord parts(VPoint steps) {
  const VPoint scaled =
      hn::Mul(steps, hn::Set(dpoint, static_cast<float>(LatticeCt::kPartsOfStep)));
  return hn::BitCast(dword, hn::NearestInt(scaled));
}

/// Samples the points of a vector, without their neighbours.
HWY_INLINE void sample(const LatticeRow& row, VPoint number, std::uint32_t* value,
                       std::uint32_t* gradient) {
  VPoint at[3];
  hn::Mask<decltype(dpoint)> inside = hn::Eq(number, number);
  for (int axis = 0; axis < 3; ++axis) {
    at[axis] =
        hn::MulAdd(number, hn::Set(dpoint, row.step[axis]), hn::Set(dpoint, row.first[axis]));
    inside = hn::And(inside, hn::And(hn::Ge(at[axis], hn::Zero(dpoint)),
                                     hn::Lt(at[axis], hn::Set(dpoint, row.cells[axis]))));
  }
  VIndex cell[3];
  for (int axis = 0; axis < 3; ++axis) {
    at[axis] = hn::IfThenElseZero(inside, at[axis]);
    cell[axis] = hn::ConvertTo(dindex, at[axis]);
    at[axis] = hn::Sub(at[axis], hn::ConvertTo(dpoint, cell[axis]));
  }
  const VIndex first = hn::Add(cell[0], hn::Add(hn::Mul(cell[1], hn::Set(dindex, row.stride_j)),
                                                hn::Mul(cell[2], hn::Set(dindex, row.stride_k))));
  const std::uint32_t* high = row.words + row.stride_k;
  const CornerWords words{
      hn::GatherIndex(dword, row.words, first), hn::GatherIndex(dword, row.words + 1, first),
      hn::GatherIndex(dword, high, first), hn::GatherIndex(dword, high + 1, first)};
  const VPoint ct =
      between(on_edge<0>(words, at[0], at[2]), on_edge<1>(words, at[0], at[2]), at[1]);
  const VPoint change =
      between(on_edge<2>(words, at[0], at[2]), on_edge<3>(words, at[0], at[2]), at[1]);
  const VPoint known = hn::IfThenElse(inside, ct, hn::Set(dpoint, row.background));
  hn::StoreU(parts(known), dword, value);
  hn::StoreU(parts(hn::IfThenElseZero(inside, change)), dword, gradient);
}

/// Puts the neighbour of each point into the high half of its word.
HWY_INLINE void add_neighbours(std::uint32_t* numbers) {
  const VWord neighbours = hn::LoadU(dword, numbers + 1);
  hn::StoreU(hn::Or(hn::LoadU(dword, numbers), hn::ShiftLeft<16>(neighbours)), dword, numbers);
}

void sample_row(const LatticeRow& row, int count, std::uint32_t* value, std::uint32_t* gradient) {
  const auto lanes = static_cast<int>(hn::Lanes(dpoint));
  // Also the neighbour of the last point.
  for (int i = 0; i < count + 1; i += lanes)
    sample(row, hn::Iota(dpoint, static_cast<float>(i)), value + i, gradient + i);
  for (int i = 0; i < count; i += lanes) {
    add_neighbours(value + i);
    add_neighbours(gradient + i);
  }
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(sample_row);

void sample_row_simd(const LatticeRow& row, int count, std::uint32_t* value,
                     std::uint32_t* gradient) {
  HWY_DYNAMIC_DISPATCH(sample_row)(row, count, value, gradient);
}

}  // namespace usct
#endif
