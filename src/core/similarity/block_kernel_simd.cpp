// Vectors of unknown size cannot be members, so SVE is left out; machines that have it run NEON.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
// The file is compiled once per instruction set; the machine's best one is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "similarity/block_kernel_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "similarity/block_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace usct::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR
void block_values(const BlockMatch& match, float* values) { block_values_scalar(match, values); }
void add_block(const BlockSum& sum) { add_block_scalar(sum); }
#else

constexpr hn::CappedTag<float, kBlockLanes> dblock;
using VBlock = hn::Vec<decltype(dblock)>;

/// The most vectors of translations at once. They share what is loaded of the ultrasound, and their
/// sums do not wait for each other.
constexpr std::size_t kAtOnce = 3;

/// The values of so many vectors of translations along x, from a point of the lattice on.
template <std::size_t kVectors>
HWY_INLINE void write_values(const BlockMatch& match, std::size_t place, float* values) {
  const std::size_t lanes = hn::Lanes(dblock);
  const auto row = static_cast<std::size_t>(match.ct.size.x());
  const std::size_t slice = row * static_cast<std::size_t>(match.ct.size.y());
  VBlock value[kVectors];
  VBlock gradient[kVectors];
  for (std::size_t v = 0; v < kVectors; ++v) value[v] = gradient[v] = hn::Zero(dblock);
  const float* ultrasound = match.ultrasound;
  for (std::size_t k = 0; k < kBlockEdge; ++k)
    for (std::size_t j = 0; j < kBlockEdge; ++j)
      for (std::size_t i = 0; i < kBlockEdge; ++i) {
        const std::size_t at = place + k * slice + j * row + i;
        const VBlock u = hn::Set(dblock, *ultrasound++);
        for (std::size_t v = 0; v < kVectors; ++v) {
          value[v] =
              hn::MulAdd(u, hn::LoadU(dblock, match.ct.value.data() + at + v * lanes), value[v]);
          gradient[v] = hn::MulAdd(u, hn::LoadU(dblock, match.ct.gradient.data() + at + v * lanes),
                                   gradient[v]);
        }
      }
  for (std::size_t v = 0; v < kVectors; ++v) {
    const auto inverse = [&](const std::vector<float>& of)
                             HWY_ATTR { return hn::LoadU(dblock, of.data() + place + v * lanes); };
    const VBlock both =
        hn::Mul(hn::Mul(hn::Set(dblock, 2.0F), inverse(match.ct.inverse_vg)), gradient[v]);
    const VBlock by_value = hn::MulAdd(inverse(match.ct.inverse_vv), value[v], both);
    const VBlock by_gradient = hn::Mul(inverse(match.ct.inverse_gg), gradient[v]);
    const VBlock explained = hn::MulAdd(by_value, value[v], hn::Mul(by_gradient, gradient[v]));
    hn::StoreU(hn::Min(explained, hn::Set(dblock, match.known)), dblock, values + v * lanes);
  }
}

void block_values(const BlockMatch& match, float* values) {
  const std::size_t lanes = hn::Lanes(dblock);
  const std::size_t row = whole_vectors(match.translations.x());
  for (int z = 0; z < match.translations.z(); ++z)
    for (int y = 0; y < match.translations.y(); ++y, values += row) {
      const std::size_t begin = match.ct.place(match.first + Eigen::Vector3i(0, y, z));
      std::size_t x = 0;
      for (; x + kAtOnce * lanes <= row; x += kAtOnce * lanes)
        write_values<kAtOnce>(match, begin + x, values + x);
      for (; x < row; x += lanes) write_values<1>(match, begin + x, values + x);
    }
}

void add_block(const BlockSum& sum) {
  const std::size_t row = whole_vectors(sum.sums_size.x());
  float* sums = sum.sums;
  for (int z = 0; z < sum.sums_size.z(); ++z)
    for (int y = 0; y < sum.sums_size.y(); ++y, sums += row) {
      const float* values = sum.values + static_cast<std::size_t>(z) * sum.slice +
                            static_cast<std::size_t>(y) * sum.row;
      for (std::size_t x = 0; x < row; x += hn::Lanes(dblock))
        hn::StoreU(hn::Add(hn::LoadU(dblock, sums + x), hn::LoadU(dblock, values + x)), dblock,
                   sums + x);
    }
}

#endif

}  // namespace usct::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace usct {

HWY_EXPORT(block_values);
HWY_EXPORT(add_block);

void block_values_simd(const BlockMatch& match, float* values) {
  HWY_DYNAMIC_DISPATCH(block_values)(match, values);
}

void add_block_simd(const BlockSum& sum) { HWY_DYNAMIC_DISPATCH(add_block)(sum); }

}  // namespace usct
#endif
