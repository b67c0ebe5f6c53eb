#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Dense>
#include <array>

#include "core/geometry/random_geometry.h"
#include "core/similarity/instructions.h"
#include "similarity/block_kernel.h"

namespace usct::test {
namespace {

using Eigen::Vector3i;

using Cells = Eigen::Matrix<double, kBlockCells, 1>;
using CellsOfCt = Eigen::Matrix<double, kBlockCells, 2>;

constexpr Ridges kRidges{22.0F, 10.0F};

/// A block of which all cells are known, and a lattice around it.
struct BlockScene {
  Vector3i translations{integer(1, 20), integer(1, 5), integer(1, 5)};
  int stride{integer(1, 3)};
  Vector3i first{integer(0, 3), integer(0, 3), integer(0, 3)};
  LatticeCt ct{first + cells(translations) + Vector3i::Constant(kBlockEdge - 1 + integer(0, 2))};
  BlockUltrasound ultrasound{};

  BlockScene() {
    for (std::size_t i = 0; i < ct.value.size(); ++i) {
      ct.value[i] = static_cast<std::uint32_t>(integer(0, 255));
      ct.gradient[i] = static_cast<std::uint32_t>(integer(0, 255));
    }
    for (auto* words : {&ct.value, &ct.gradient})
      for (std::size_t i = 0; i + 3 < words->size(); ++i)
        (*words)[i] |= (*words)[i + 1] << 8 | (*words)[i + 2] << 16 | (*words)[i + 3] << 24;
    invert_covariances_simd(ct, kRidges);
    Cells cells;
    for (double& cell : cells) cell = uniform(-2.0, 2.0);
    set_ultrasound(cells);
  }
  /// As bright as these cells, but for scale and offset, and rounded.
  void set_ultrasound(Cells cells) {
    cells.array() -= cells.mean();
    cells *= (kMostOfCell - 1) / cells.cwiseAbs().maxCoeff();
    cells = cells.array().round();
    // Rounding must not leave a sum, which the covariances do not know.
    for (int i = 0; cells.sum() != 0.0; ++i)
      cells[i % kBlockCells] -= cells.sum() > 0.0 ? 1.0 : -1.0;
    for (int i = 0; i < kBlockCells; ++i)
      ultrasound.cells[static_cast<std::size_t>(i)] = static_cast<std::int8_t>(cells[i]);
    ultrasound.norm = static_cast<float>(cells.norm());
    ultrasound.known = kBlockCells;
  }
  /// By so many cells a translation moves the block.
  Vector3i cells(const Vector3i& translation) const {
    return translation.cwiseProduct(Vector3i(1, stride, stride));
  }
  BlockMatch match() const { return {ct, first, translations, stride, ultrasound}; }
  std::size_t values() const {
    return whole_vectors(translations.x()) *
           static_cast<std::size_t>(translations.y() * translations.z());
  }
  /// The samples of the CT under the block, minus their means, as columns.
  CellsOfCt under(const Vector3i& translation) const {
    CellsOfCt columns;
    int row = 0;
    for (int k = 0; k < kBlockEdge; ++k)
      for (int j = 0; j < kBlockEdge; ++j)
        for (int i = 0; i < kBlockEdge; ++i, ++row) {
          const std::size_t at = ct.place(first + cells(translation) + Vector3i(i, j, k));
          columns(row, 0) = LatticeCt::byte(ct.value[at]);
          columns(row, 1) = LatticeCt::byte(ct.gradient[at]);
        }
    columns.rowwise() -= columns.colwise().mean();
    return columns;
  }
};

std::vector<std::uint8_t> values_of(const BlockScene& scene,
                                    decltype(&block_values_scalar) kernel) {
  std::vector<std::uint8_t> values(scene.values());
  kernel(scene.match(), values.data());
  return values;
}

template <typename Use>
void for_translations(const BlockScene& scene, const Use& use) {
  std::size_t row = 0;
  for (int z = 0; z < scene.translations.z(); ++z)
    for (int y = 0; y < scene.translations.y(); ++y, row += whole_vectors(scene.translations.x()))
      for (int x = 0; x < scene.translations.x(); ++x)
        use(Vector3i(x, y, z), row + static_cast<std::size_t>(x));
}

/// Ridge regression by its normal equations, in double precision.
RC_GTEST_PROP(BlockKernel, ValuesAreWhatALinearFunctionOfTheCtExplains, ()) {
  const BlockScene scene;
  const std::vector<std::uint8_t> values = values_of(scene, block_values_scalar);
  Cells u;
  for (int i = 0; i < kBlockCells; ++i) u[i] = scene.ultrasound.cells[static_cast<std::size_t>(i)];
  u.normalize();
  for_translations(scene, [&](const Vector3i& translation, std::size_t at) {
    const CellsOfCt ct = scene.under(translation);
    const Eigen::Vector2d product = ct.transpose() * u;
    Eigen::Matrix2d covariance = ct.transpose() * ct / kBlockCells;
    covariance.diagonal() += Eigen::Vector2d(kRidges.value, kRidges.gradient);
    const double explained = product.dot(covariance.ldlt().solve(product));
    RC_ASSERT(std::abs(values[at] - static_cast<double>(kPartsOfCell) * explained) < 0.6);
  });
}

RC_GTEST_PROP(BlockKernel, UltrasoundThatIsALinearFunctionOfTheCtIsExplainedThere, ()) {
  BlockScene scene;
  const Vector3i where(integer(0, scene.translations.x() - 1),
                       integer(0, scene.translations.y() - 1),
                       integer(0, scene.translations.z() - 1));
  scene.set_ultrasound(scene.under(where) * Eigen::Vector2d(uniform(0.5, 2.0), uniform(-9.0, 9.0)));
  const std::vector<std::uint8_t> values = values_of(scene, block_values_scalar);
  for_translations(scene, [&](const Vector3i& translation, std::size_t at) {
    if (translation == where)
      RC_ASSERT(values[at] > 245);  // of 255, all but the ridge
    else
      RC_ASSERT(values[at] < 230);
  });
}

RC_GTEST_PROP(BlockKernel, AllInstructionsGiveTheValuesOfTheReference, ()) {
  const BlockScene scene;
  const std::vector<std::uint8_t> expected = values_of(scene, block_values_scalar);
  for (const std::int64_t target : Instructions::all()) {
    const Instructions used(target);
    const std::vector<std::uint8_t> values = values_of(scene, block_values_simd);
    for_translations(scene, [&](const Vector3i&, std::size_t at) {
      RC_ASSERT(std::abs(values[at] - expected[at]) <= 1);  // sums are rounded in another order
    });
  }
}

/// Cells that are as large as they may be, where the CT is as large, do not exceed any number.
TEST(BlockKernel, HoldsTheLargestProducts) {
  LatticeCt ct(Vector3i::Constant(kBlockEdge));
  BlockUltrasound ultrasound;
  for (std::size_t i = 0; i < kBlockCells; ++i) {
    const bool bright = i < kBlockCells / 2;
    ct.value[i] = ct.gradient[i] = bright ? 0xFFFFFFFFU : 0U;
    ultrasound.cells[i] = static_cast<std::int8_t>(bright ? kMostOfCell : -kMostOfCell);
  }
  ultrasound.norm = kMostOfCell * std::sqrt(static_cast<float>(kBlockCells));
  ultrasound.known = kBlockCells;
  invert_covariances_simd(ct, {65025.0F, 65025.0F});
  const BlockMatch match{ct, Vector3i::Zero(), Vector3i::Ones(), 1, ultrasound};
  std::vector<std::uint8_t> expected(kBlockLanes), values(kBlockLanes);
  block_values_scalar(match, expected.data());
  // The variance of both is a quarter of the ridge, which leaves a third of what they explain.
  EXPECT_NEAR(expected.front(), 255.0 / 3.0, 1.0);
  for (const std::int64_t target : Instructions::all()) {
    const Instructions used(target);
    block_values_simd(match, values.data());
    EXPECT_NEAR(values.front(), expected.front(), 1.0);
  }
}

/// Values of four blocks from anywhere in their rows on, added to sums that are small, or close to
/// the largest number.
RC_GTEST_PROP(BlockKernel, SumsAreOfTheValuesAtShiftedTranslations, ()) {
  const Vector3i size(integer(1, 20), integer(1, 4), integer(1, 4));
  const auto before = static_cast<std::uint16_t>(integer(0, 1) == 0 ? 7 : 65000);
  std::array<std::vector<std::uint8_t>, kBlocksAdded> values;
  BlockSum sum{{}, size, nullptr};
  for (std::size_t b = 0; b < kBlocksAdded; ++b) {
    const Vector3i shift(integer(0, 5), integer(0, 2), integer(0, 2));
    const std::size_t row = whole_vectors(size.x() + shift.x());
    const std::size_t slice = row * static_cast<std::size_t>(size.y() + shift.y());
    values[b].resize(slice * static_cast<std::size_t>(size.z() + shift.z()) + kBlockLanes);
    for (std::uint8_t& value : values[b]) value = static_cast<std::uint8_t>(integer(0, 255));
    sum.blocks[b] = BlockValues{values[b].data(), row, slice}.from(shift);
  }
  const std::size_t row = whole_vectors(size.x());
  const auto sums_of = [&](decltype(&add_blocks_scalar) add) {
    std::vector<std::uint16_t> sums(row * static_cast<std::size_t>(size.y() * size.z()), before);
    sum.sums = sums.data();
    add(sum);
    return sums;
  };
  for (const std::int64_t target : Instructions::all()) {
    const Instructions used(target);
    for (const auto& sums : {sums_of(add_blocks_scalar), sums_of(add_blocks_simd)})
      for (int z = 0; z < size.z(); ++z)
        for (int y = 0; y < size.y(); ++y)
          for (int x = 0; x < size.x(); ++x) {
            int expected = before;
            for (const BlockValues& block : sum.blocks) expected += *block.from({x, y, z}).first;
            const std::size_t at =
                static_cast<std::size_t>(x) + row * static_cast<std::size_t>(y + size.y() * z);
            RC_ASSERT(sums[at] == std::min(expected, 65535));
          }
  }
}

}  // namespace
}  // namespace usct::test
