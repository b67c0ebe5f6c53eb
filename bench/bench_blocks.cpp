#include <cstdint>
#include <optional>
#include <vector>

#include "core/similarity/instructions.h"
#include "finish.h"
#include "similarity/block_kernel.h"

namespace usct {
namespace {

using Kernel = std::int64_t;  // instructions of the vector kernel, or none
constexpr Kernel kScalar = -1;

/// Makes the vector kernel run with some instructions, if the processor has them.
class Used {
 public:
  Used(benchmark::State& state, Kernel kernel)
      : available_(kernel == kScalar || (hwy::SupportedTargets() & kernel) != 0) {
    if (!available_) state.SkipWithError("this processor lacks the instructions");
    if (available_ && kernel != kScalar) instructions_.emplace(kernel);
  }
  bool available() const { return available_; }

 private:
  bool available_;
  std::optional<test::Instructions> instructions_;
};

constexpr Ridges kRidges{22.0F, 22.0F};

/// Bytes as those of a CT at the points of a lattice.
LatticeCt lattice(const Eigen::Vector3i& size) {
  LatticeCt lattice(size);
  for (std::size_t i = 0; i < lattice.value.size(); ++i) {
    lattice.value[i] = static_cast<std::uint32_t>(i * 7919 % 95 + 94);
    lattice.gradient[i] = static_cast<std::uint32_t>(i * 104729 % 45);
  }
  for (auto* words : {&lattice.value, &lattice.gradient})
    for (std::size_t i = 0; i + 3 < words->size(); ++i)
      (*words)[i] |= (*words)[i + 1] << 8 | (*words)[i + 2] << 16 | (*words)[i + 3] << 24;
  invert_covariances_simd(lattice, kRidges);
  return lattice;
}

/// A block of ultrasound at as many translations of the CT as a search with 25 mm and 25 degrees
/// has, or at every other one along two axes.
void match_block(benchmark::State& state, Kernel kernel, int stride) {
  const Used used(state, kernel);
  if (!used.available()) return;
  const Eigen::Vector3i translations(28, 28 / stride, 28 / stride);
  const LatticeCt ct = lattice(Eigen::Vector3i(97, 75, 81));
  BlockUltrasound block;
  for (std::size_t i = 0; i < block.cells.size(); ++i)
    block.cells[i] = static_cast<std::int8_t>(i % 2 == 0 ? kMostOfCell : -kMostOfCell);
  block.norm = 8.0F * kMostOfCell;
  block.known = 64.0F;
  std::vector<std::uint8_t> values(28 * 28 * whole_vectors(28));
  const auto values_of = kernel == kScalar ? block_values_scalar : block_values_simd;
  for (auto _ : state) {
    values_of({ct, Eigen::Vector3i(20, 20, 20), translations, stride, block}, values.data());
    benchmark::DoNotOptimize(values.data());
  }
  finish(state, translations.prod());
}

/// The rotations of a search of that size, for four blocks.
void add_blocks(benchmark::State& state, Kernel kernel) {
  const Used used(state, kernel);
  if (!used.available()) return;
  constexpr int kRotations = 64;
  const Eigen::Vector3i translations(15, 15, 15);
  const std::size_t row = whole_vectors(28);
  const std::vector<std::uint8_t> values(row * 28 * 28, 9);
  std::vector<std::uint16_t> sums(kRotations * 15 * 15 * whole_vectors(15));
  const auto add = kernel == kScalar ? add_blocks_scalar : add_blocks_simd;
  for (auto _ : state)
    for (int r = 0; r < kRotations; ++r) {
      BlockSum sum{
          {}, translations, &sums[static_cast<std::size_t>(r) * 15 * 15 * whole_vectors(15)]};
      sum.blocks.fill(BlockValues{values.data(), row, row * 28}.from({r % 12, r % 13, r % 11}));
      add(sum);
      benchmark::DoNotOptimize(sums.data());
    }
  finish(state, kRotations * translations.prod() * static_cast<int>(kBlocksAdded));
}

void invert_covariances(benchmark::State& state, Kernel kernel) {
  const Used used(state, kernel);
  if (!used.available()) return;
  LatticeCt ct = lattice(Eigen::Vector3i(97, 75, 81));
  const auto invert = kernel == kScalar ? invert_covariances_scalar : invert_covariances_simd;
  for (auto _ : state) {
    invert(ct, kRidges);
    benchmark::DoNotOptimize(ct.inverse_vv.data());
  }
  finish(state, ct.size.prod());
}

constexpr auto kMs = benchmark::kMillisecond;
BENCHMARK_CAPTURE(match_block, scalar, kScalar, 1)->Unit(kMs);
BENCHMARK_CAPTURE(match_block, scalar_every_other, kScalar, 2)->Unit(kMs);
BENCHMARK_CAPTURE(match_block, avx2, HWY_AVX2, 1)->Unit(kMs);
BENCHMARK_CAPTURE(match_block, avx2_every_other, HWY_AVX2, 2)->Unit(kMs);
BENCHMARK_CAPTURE(match_block, avx512, HWY_AVX3, 1)->Unit(kMs);
BENCHMARK_CAPTURE(match_block, avx512_every_other, HWY_AVX3, 2)->Unit(kMs);
BENCHMARK_CAPTURE(match_block, avx512_vnni, HWY_AVX3_DL, 1)->Unit(kMs);
BENCHMARK_CAPTURE(match_block, avx512_vnni_every_other, HWY_AVX3_DL, 2)->Unit(kMs);
BENCHMARK_CAPTURE(add_blocks, scalar, kScalar)->Unit(kMs);
BENCHMARK_CAPTURE(add_blocks, avx2, HWY_AVX2)->Unit(kMs);
BENCHMARK_CAPTURE(add_blocks, avx512, HWY_AVX3)->Unit(kMs);
BENCHMARK_CAPTURE(invert_covariances, scalar, kScalar)->Unit(kMs);
BENCHMARK_CAPTURE(invert_covariances, avx2, HWY_AVX2)->Unit(kMs);
BENCHMARK_CAPTURE(invert_covariances, avx512, HWY_AVX3)->Unit(kMs);

}  // namespace
}  // namespace usct
